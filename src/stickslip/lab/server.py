"""The lab's server: the page, what it asks for, and the workers behind.

It waits only so long for the rest of a request, and for so many at a time: half a request costs nobody else.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any, ClassVar

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from uvicorn.protocols.http.h11_impl import H11Protocol

import stickslip as ss
from stickslip.lab import data, live, play
from stickslip.lab.openapi import described, document
from stickslip.lab.security import Guard
from stickslip.lab.workers import Workers

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
    return [
        *play.routes,
        *data.routes,
        *live.routes,
        Route("/openapi.json", _openapi),
        Route("/alive", _alive),
    ]


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
