"""The lab's server: the page, what it asks for, and the workers behind."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

import stickslip as ss
from stickslip.lab import data, maps, play
from stickslip.lab.openapi import described, document
from stickslip.lab.security import Guard
from stickslip.lab.serving import DOORWAY
from stickslip.lab.workers import Workers

PAGE = Path(__file__).parent / "page"
WORKERS = 2


def lab_app(*, token: str, port: int) -> Starlette:
    """The application: guarded, with its page and all that the page asks for.

    Parameters
    ----------
    token : str
        The secret that every request states, in its cookie or as a bearer.
    port : int
        Where it will listen: requests for another host or port are refused.

    Returns
    -------
    Starlette
    """
    return Starlette(
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


def _routes() -> list[BaseRoute]:
    return [
        *play.routes,
        *maps.routes,
        *data.routes,
        Route("/openapi.json", _openapi),
        Route("/alive", _alive),
    ]


@asynccontextmanager
async def _lifespan(app: Starlette) -> AsyncIterator[None]:
    async with AsyncExitStack() as stack:
        app.state.workers = await stack.enter_async_context(Workers(WORKERS))
        app.state.opened = asyncio.Event()
        await stack.enter_async_context(data.lifespan(app))
        beside = [
            asyncio.create_task(play.warmed(app.state.workers, app.state.opened)),
            asyncio.create_task(_shut(app.state.data.folder / DOORWAY, app.state.opened)),
        ]
        yield
        for task in beside:
            task.cancel()
        await asyncio.gather(*beside, return_exceptions=True)


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
    bare = {"Not Found": f"There is nothing at {request.url.path}.",
            "Method Not Allowed": f"{request.method} has no meaning at that address."}  # fmt: skip
    sentence = bare.get(error.detail, error.detail)
    return JSONResponse({"error": str(sentence)}, error.status_code, headers=error.headers)


async def _gone(request: Request, error: Exception) -> Response:
    return Response(status_code=400)  # to nobody


async def _unanswered(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, 422)


async def _broken(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": f"The lab failed at this request ({type(error).__name__}); others go on."}, 500)
