"""Who may speak with the lab: this machine's own page, with the token; and what its answers may do in a browser."""

from __future__ import annotations

import asyncio
import secrets
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import cookie_parser
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from stickslip.lab.uploads import LARGEST

HOSTS = ("127.0.0.1", "localhost")
LIMIT = 2**20  # bytes of a request
LIMITS = {"/files": LARGEST}  # by how the path begins: records are large
SILENCE = 60.0  # seconds without a byte of a body after which its sender is given up
ENTRANCE = "/enter.js"  # what leads a copied link to the page; it holds no secret
VIOLATION = 1008  # RFC 6455: against the policy
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "media-src blob: data:; connect-src 'self' {sockets}; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}


class Guard:
    """The door: every request states our host, comes from no other page and knows the token; none is too large.

    A browser's cookies go to every port of a host. The page's own is therefore for a path that is secret too, and of
    this start: at another port the browser does not know that it has it.

    Parameters
    ----------
    app : ASGI application
        What is behind it.
    token : str
        The secret of this start.
    port : int
        Where the lab listens.
    """

    def __init__(self, app: ASGIApp, *, token: str, port: int) -> None:
        self.app, self.token, self.cookie = app, token, f"stickslip-{port}"
        self.inside = f"/{secrets.token_urlsafe(16)}"
        self.hosts = {f"{host}:{port}" for host in HOSTS}
        self.origins = {f"http://{host}" for host in self.hosts}
        sockets = " ".join(f"ws://{host}" for host in sorted(self.hosts))
        self.headers = {name: value.format(sockets=sockets) for name, value in HEADERS.items()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        inside = scope["path"].startswith(f"{self.inside}/")
        if inside:
            scope = {**scope, "path": scope["path"].removeprefix(self.inside)}
        answer = self._refused(scope) or self._welcomed(scope, inside)
        if scope["type"] == "websocket":
            await (WebSocketClose(VIOLATION, "not from this page") if answer else self.app)(scope, receive, send)
            return
        guarded = self._marked(send)
        await (answer or self.app)(scope, receive if answer else _counted(scope, receive), guarded)

    def _refused(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        if [host.lower() for host in headers.getlist("host")] not in [[host] for host in self.hosts]:
            return _refusal(400, "This lab answers at 127.0.0.1 alone; open the address that it printed.")
        if not {origin.lower() for origin in headers.getlist("origin")} <= self.origins:
            return _refusal(403, "Another page may not use this lab; open the address that it printed.")
        return None

    def _welcomed(self, scope: Scope, inside: bool) -> Response | None:
        """Nothing for who knows the token; the page's address with it is exchanged for a cookie and the way inside."""
        headers = Headers(scope=scope)
        token = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if scope["type"] == "http" and scope["path"] == "/" and self._known(token):
            page = RedirectResponse(f"{self.inside}/", status_code=303)
            page.set_cookie(self.cookie, self.token, httponly=True, samesite="lax", path=f"{self.inside}/")
            return page
        scheme, _, bearer = headers.get("authorization", "").partition(" ")
        cookie = cookie_parser(headers.get("cookie", "")).get(self.cookie, "") if inside else ""
        if self._known(cookie) or (scheme.lower() == "bearer" and self._known(bearer)):
            return None
        if scope["path"] == ENTRANCE:
            return None
        sentence = "The token is missing or of another start; open the address that 'stickslip lab' printed."
        if scope["path"] == "/" and "text/html" in headers.get("accept", ""):
            return HTMLResponse(f'<!doctype html><script src="{ENTRANCE}"></script><p>{sentence}', 401)
        return _refusal(401, sentence)

    def _known(self, token: str) -> bool:
        return secrets.compare_digest(token.encode("utf-8", "surrogateescape"), self.token.encode())

    def _marked(self, send: Send) -> Send:
        """`send`, with the headers that hold the browser to this page."""

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                held = MutableHeaders(scope=message)
                for name, value in self.headers.items():
                    held.setdefault(name, value)  # a report's own are stricter
            await send(message)

        return sending


def _counted(scope: Scope, receive: Receive) -> Receive:
    """`receive`, ended where more comes than the path takes, whatever length was stated, or nothing for long."""
    limit = next((most for start, most in LIMITS.items() if scope["path"].startswith(start)), LIMIT)
    taken, coming = 0, True

    async def receiving() -> Message:
        nonlocal taken, coming
        try:
            async with asyncio.timeout(SILENCE if coming else None):
                message = await receive()
        except TimeoutError as error:
            raise HTTPException(408, f"Nothing came for {SILENCE:g} s: the request ended; send it again.") from error
        coming = message.get("more_body", False)
        taken += len(message.get("body", b""))
        if taken > limit:
            raise HTTPException(413, f"The request is larger than the {limit / 2**20:g} MB taken here; send less.")
        return message

    return receiving


def _refusal(status: int, sentence: str) -> Response:
    return JSONResponse({"error": sentence}, status)
