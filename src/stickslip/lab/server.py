"""The lab's server: the page, what it asks for, the workers behind, and who may speak with it.

It waits only so long for the rest of a request, and for so many at a time: half a request costs nobody else.

Who may is this machine's own page, with the token; what its answers may do in a browser is said with each.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import signal
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, ClassVar
from urllib.parse import parse_qs

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request, cookie_parser
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose
from uvicorn.protocols.http.h11_impl import H11Protocol

import stickslip as ss
from stickslip.lab import data, live, play
from stickslip.lab.data import LARGEST
from stickslip.lab.openapi import described, document
from stickslip.lab.workers import Workers

HOST = "127.0.0.1"
HOSTS = (HOST, "localhost")
LARGEST_MESSAGE = 2**20  # bytes on a socket
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
            return _turned_away(400, "This lab answers at 127.0.0.1 alone; open the address that it printed.")
        if not {origin.lower() for origin in headers.getlist("origin")} <= self.origins:
            return _turned_away(403, "Another page may not use this lab; open the address that it printed.")
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
        return _turned_away(401, sentence)

    def _known(self, token: str) -> bool:
        return secrets.compare_digest(token.encode("utf-8", "surrogateescape"), self.token.encode())

    def _marked(self, send: Send) -> Send:
        """`send`, with the headers that hold the browser to this page."""

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self.headers.items():
                    headers.setdefault(name, value)  # a report's own are stricter
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


def _turned_away(status: int, sentence: str) -> Response:
    return JSONResponse({"error": sentence}, status)


PAGE = Path(__file__).parent / "page"
WORKERS = 2
DOORWAY = "open.html"  # in the folder of a run, until a page is open
PATIENCE = 10.0  # s from a connection's opening, or its last answer, to the end of the next request's head
MOST = 256  # connections without a request at work that may take that long; a page keeps six, so some forty pages
HURRY = 3.0  # s for those that come when there are more: an honest one sends its head as soon as it is open,
# but on a busy machine even that was seen to take more than a second


def lab_app(*, token: str, port: int, place: live.Place | None = None) -> Starlette:
    """The application: guarded, with its page and all that the page asks for.

    Parameters
    ----------
    token : str
        The secret that every request states, in its cookie or as a bearer.
    port : int
        Where it will listen: requests for another host or port are refused.
    place : live.Place, optional
        The devices that may be watched, and where recordings go; the virtual rig and the current folder where left out.

    Returns
    -------
    Starlette
    """
    app = Starlette(
        routes=[*_routes(), Mount("/", StaticFiles(directory=PAGE, html=True))],
        middleware=[Middleware(Guard, token=token, port=port)],
        exception_handlers={
            HTTPException: _refusal,
            ClientDisconnect: _gone,
            ss.StickslipError: _unanswered,
            Exception: _broken,
        },
        lifespan=_lifespan,
    )
    app.state.place = place or live.Place()
    return app


def _routes() -> list[BaseRoute]:
    return [*play.routes, *data.routes, *live.routes, Route("/openapi.json", _openapi), Route("/alive", _alive)]


@asynccontextmanager
async def _lifespan(app: Starlette) -> AsyncIterator[None]:
    async with AsyncExitStack() as stack:
        app.state.workers = await stack.enter_async_context(Workers(WORKERS))
        app.state.opened = asyncio.Event()
        await stack.enter_async_context(data.lifespan(app))
        await stack.enter_async_context(live.lifespan(app, app.state.place))
        beside = [
            asyncio.create_task(play.warmed(app.state.workers, app.state.opened)),
            asyncio.create_task(_shut(app.state.data.folder / DOORWAY, app.state.opened)),
        ]
        yield
        for task in beside:
            task.cancel()
        await asyncio.gather(*beside, return_exceptions=True)


def doorway(folder: Path, address: str) -> Path:
    """A file for this user's eyes that leads a browser to the address: arguments of a program are seen by all."""
    page = folder / DOORWAY
    with os.fdopen(os.open(page, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(f'<!doctype html><title>stickslip lab</title><meta http-equiv="refresh" content="0; url={address}">')
    return page


async def _shut(doorway: Path, opened: asyncio.Event) -> None:
    """Remove the file that led a browser here, once it is here."""
    await opened.wait()
    doorway.unlink(missing_ok=True)


async def _openapi(request: Request) -> Response:
    return JSONResponse(document(_routes()))


@described("Is the lab there, and which version?", answer={"type": "object", "required": ["version"]})
async def _alive(request: Request) -> Response:
    return JSONResponse({"version": ss.__version__})


async def _refusal(request: Request, error: Any) -> Response:
    bare = {
        "Not Found": f"There is nothing at {request.url.path}.",
        "Method Not Allowed": f"{request.method} has no meaning at that address.",
    }
    sentence = bare.get(error.detail, error.detail)
    return JSONResponse({"error": str(sentence)}, error.status_code, headers=error.headers)


async def _gone(request: Request, error: Exception) -> Response:
    return Response(status_code=400)  # to nobody


async def _unanswered(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, 422)


async def _broken(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": f"The lab failed at this request ({type(error).__name__}); others go on."}, 500)


class PatientProtocol(H11Protocol):
    """HTTP of which a connection without a request at work is closed after a time, a short one if there are many.

    Such a connection is one that has sent nothing, a part of a head, or goes on with a body that was answered already.
    None is closed at once: what an honest one sent may not have been read yet. While a request is at work, what
    answers it decides how long it waits for the body.
    """

    waiting: ClassVar[dict[PatientProtocol, asyncio.TimerHandle]] = {}
    most, patience, hurry = MOST, PATIENCE, HURRY

    def connection_made(self, transport: Any) -> None:
        """Wait for a head."""
        super().connection_made(transport)
        self._look()

    def data_received(self, data: bytes) -> None:
        """Take what has come; a head that is whole ends the waiting, not a part of one."""
        super().data_received(data)
        self._look()

    def on_response_complete(self) -> None:
        """Wait for the next head."""
        self._leave()  # what comes next has its own time
        super().on_response_complete()
        self._look()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no more."""
        self._leave()
        super().connection_lost(exc)

    def _look(self) -> None:
        """Whether the connection waits, now."""
        at_work = self.cycle is not None and not self.cycle.response_complete
        upgraded = self.transport.get_protocol() is not self
        if at_work or upgraded or self.transport.is_closing():
            self._leave()
        elif self not in self.waiting:
            time = self.patience if len(self.waiting) < self.most else self.hurry
            self.waiting[self] = self.loop.call_later(time, self._give_up)

    def _leave(self) -> None:
        timer = self.waiting.pop(self, None)
        if timer is not None:
            timer.cancel()

    def _give_up(self) -> None:
        self._leave()
        self.transport.abort()


def listening(port: int) -> socket.socket:
    """The port, taken; 0 takes any that is free.

    Raises
    ------
    ModelError
        Another program has it, or it is for the administrator alone.
    """
    door = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        door.bind((HOST, port))
    except PermissionError as error:
        door.close()
        raise ss.errors.ModelError(
            f"port {port} may not be used",
            "the lowest ports are for the administrator",
            "choose one above 1023 with --port",
        ) from error
    except OSError as error:
        door.close()
        raise ss.errors.ModelError(
            f"port {port} is taken ({error.strerror})", "the lab needs one of its own", "choose another with --port"
        ) from error
    return door


def serve(
    door: socket.socket,
    *,
    token: str,
    opened: Callable[[Callable[[str], Path]], None],
    rig: Path | None = None,
    records: Path | None = None,
) -> None:
    """Answer at the door until Ctrl-C; `opened` is called when it does, with what writes a page that leads a browser
    to an address. `rig` is the file of the rig whose devices may be watched, and `records` the folder of recordings.
    """

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started:
                opened(partial(doorway, app.state.data.folder))

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            if sig != signal.SIGINT:
                super().handle_exit(sig, frame)
            self.should_exit = True  # Ctrl-C is not handed on: a second would tear down what is being closed

    app = lab_app(token=token, port=door.getsockname()[1], place=live.place_of(rig, records))
    settings = uvicorn.Config(
        app,
        http=PatientProtocol,
        log_level="warning",
        access_log=False,
        ws_max_size=LARGEST_MESSAGE,
        server_header=False,
        date_header=False,
        timeout_graceful_shutdown=2,
        ws_per_message_deflate=False,
    )
    listener = Server(settings)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, listener.handle_exit)  # a terminal that closes leaves no files behind either
    listener.run(sockets=[door])
