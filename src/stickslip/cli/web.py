"""Open a local page in the browser for all steps from a log to an exported setting.

stickslip web
stickslip web --projects friction --port 8765 --no-browser

The page needs no network: the server listens only on this machine's own addresses, and the printed address contains the
token that every request needs. Logs, models, settings and reports are kept in a folder of projects.
"""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "open a local page in the browser for all steps"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: address and folder of projects."""
    parser.add_argument(
        "--projects", type=Path, default=Path.home() / "stickslip-projects", metavar="DIR",
        help="folder of the projects (default: stickslip-projects in your home folder)",
    )  # fmt: skip
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port (default: any free port)")
    parser.add_argument(
        "--host", default="", metavar="ADDRESS",
        help="also listen on this address; access needs the token only, "
        "and the connection is not encrypted",
    )  # fmt: skip
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    parser.add_argument(
        "--max-upload",
        type=float,
        default=2048.0,
        metavar="MB",
        help="largest accepted file (default 2048)",
    )
    parser.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="number of parallel long jobs (default 2)"
    )


def run(args: argparse.Namespace) -> int:
    """Serve until interrupted."""
    from stickslip.core.errors import InputError

    if not 0 <= args.port < 65536:
        raise InputError(f"--port {args.port} must be a number from 0 to 65535")
    if not 0.0 < args.max_upload < 1e6:
        raise InputError(f"--max-upload {args.max_upload:g} must be greater than 0 and below a million MB")
    if args.jobs < 1:
        raise InputError(f"--jobs {args.jobs} must be at least 1")
    try:
        from stickslip.web.server import serve
    except ModuleNotFoundError as error:
        raise InputError(
            f"the page needs the package {error.name}; run `pip install 'stickslip[web]'`"
        ) from None
    serve(
        args.projects, port=args.port, host=args.host, browser=not args.no_browser,
        max_upload=int(args.max_upload * 2**20), jobs=args.jobs, tell=lambda line: print(line, flush=True),
    )  # fmt: skip
    return 0
