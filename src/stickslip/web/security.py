"""Access control: only this machine's own page, opened with the token that `stickslip web` printed.

The token is in the URL's fragment, which a browser never sends; the page posts it once and gets a same-site cookie for
it. Host and Origin are compared with the server's addresses, so other pages get no access, even with DNS rebinding.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SESSION = "/api/session"
"""Address that exchanges the token for a cookie; the only one under /api that needs none."""
CHANGING = ("POST", "PUT", "PATCH", "DELETE")
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'self'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Default headers of answers."""


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(32)


def same(given: str, token: str) -> bool:
    """Whether two texts are equal, compared in constant time."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), token.encode())


class Gate:
    """Passes only requests from the server's own page.

    Parameters
    ----------
    app : ASGI application
    token : str
    hosts : iterable of str
        Allowed Host headers, such as ``127.0.0.1:8765``; allowed Origins are ``http://`` and one of these.
    cookie : str
        Name of the cookie. Cookies are shared between ports, so two servers need two names.
    """

    def __init__(self, app: ASGIApp, token: str, hosts: Iterable[str], cookie: str) -> None:
        self.app, self.token, self.cookie = app, token, cookie
        self.hosts = frozenset(h.lower() for h in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass or refuse a request."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        refused = self._refusal(scope)
        await (refused or self.app)(scope, receive, guarded)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self.hosts:
            return JSONResponse({"error": "this server answers only at its own address"}, 403)
        origin = headers.get("origin")
        if origin is not None and origin.lower() not in {f"http://{h}" for h in self.hosts}:
            return JSONResponse(
                {"error": "this request comes from another page; only this server's own is allowed"}, 403
            )
        path = scope["path"]
        asking = headers.get("sec-fetch-site", "none")
        if path.startswith("/api/") and asking not in ("same-origin", "none"):
            return JSONResponse(
                {"error": "this request comes from another page; only this server's own is allowed"}, 403
            )
        if path.startswith("/api/") and path != SESSION and not self._known(headers):
            return JSONResponse({"error": "no token; open the address that `stickslip web` printed"}, 401)
        if (
            scope["method"] in CHANGING
            and headers.get("content-type", "").partition(";")[0].strip() in FORM_TYPES
        ):
            return JSONResponse({"error": "forms are not accepted; send JSON or a file"}, 415)
        return None

    def _known(self, headers: Headers) -> bool:
        jar: SimpleCookie = SimpleCookie()
        try:
            for line in headers.getlist("cookie"):
                jar.load(line)
        except CookieError:
            return False
        return self.cookie in jar and same(jar[self.cookie].value, self.token)


FORM_TYPES = ("application/x-www-form-urlencoded", "multipart/form-data", "text/plain")
"""Content types that other pages can send without a preflight request; this page uses none of them."""
