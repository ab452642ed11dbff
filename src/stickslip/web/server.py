"""The server: sockets on this machine's own addresses, a line with the page's address, an orderly end."""

from __future__ import annotations

import asyncio
import errno
import socket
import sys
import webbrowser
from collections.abc import Callable
from pathlib import Path

import uvicorn

from stickslip.core.errors import InputError
from stickslip.core.messages import Surface, shown_on
from stickslip.web.app import Options, make_app
from stickslip.web.security import new_token

OWN = ("127.0.0.1", "::1")


def serve(
    projects: Path, *, port: int = 0, host: str = "", browser: bool = True, max_upload: int = 2 * 2**30, jobs: int = 2,
    tell: Callable[[str], None] = print,
) -> None:  # fmt: skip
    """Serve the page until it is interrupted.

    Parameters
    ----------
    projects : Path
        Folder of the projects; it is made.
    port : int
        0: any free one.
    host : str
        An additional address; whoever reaches it and has the token has full access.
    browser : bool
        Whether to open the page in a browser.
    max_upload : int
        Largest accepted file, bytes.
    jobs : int
        Number of parallel identifications, recommendations, ...
    tell : callable
        Called with the address of the page.

    Raises
    ------
    InputError
        If the port is taken, the address is not this machine's, or the folder cannot be written.
    """
    sockets = listening((host,) if host else OWN, port)
    port = sockets[0].getsockname()[1]
    names = [bracketed(host)] if host else ["127.0.0.1", "[::1]", "localhost"]
    token = new_token()
    app = make_app(Options(
        projects, token, [f"{name}:{port}" for name in names], f"stickslip-{port}", max_upload, jobs
    ))  # fmt: skip
    config = uvicorn.Config(
        app, log_level="critical", access_log=False, lifespan="on", ws="none", server_header=False,
        timeout_keep_alive=30, h11_max_incomplete_event_size=32768, timeout_graceful_shutdown=2,
    )  # fmt: skip
    address = f"http://{names[0]}:{port}/#token={token}"
    if host:
        print(
            f"stickslip: {host} is not this machine alone: whoever reaches it and knows the token can read and change "
            "the projects, and nothing is encrypted",
            file=sys.stderr,
        )
    tell(address)
    if browser:
        webbrowser.open(address)
    server = uvicorn.Server(config)
    with shown_on(Surface.PAGE):
        asyncio.run(server.serve(sockets=sockets))


def bracketed(host: str) -> str:
    """Return an address in the form of URLs."""
    return f"[{host}]" if ":" in host else host


def listening(addresses: tuple[str, ...], port: int) -> list[socket.socket]:
    """Return sockets that listen on the same port of every address, without addresses that this machine lacks.

    Raises
    ------
    InputError
    """
    sockets: list[socket.socket] = []
    for address in addresses:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            found = socket.socket(family, socket.SOCK_STREAM)
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                found.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            found.bind((address, port))
            found.listen(128)
        except OSError as error:
            if sockets and error.errno in (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT):
                continue  # no IPv6 here
            for other in sockets:
                other.close()
            raise InputError(
                f"cannot listen on {bracketed(address)}:{port} ({error.strerror}); choose another --port or --host"
            ) from None
        sockets.append(found)
        port = found.getsockname()[1]
    return sockets
