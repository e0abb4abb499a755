"""The lab listens, on this machine alone."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import stickslip as ss
from stickslip.lab import DOORWAY

LARGEST_MESSAGE = 2**20  # bytes on a socket
HOST = "127.0.0.1"


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


def doorway(folder: Path, address: str) -> Path:
    """A file for this user's eyes that leads a browser to the address: arguments of a program are seen by all."""
    page = folder / DOORWAY
    with os.fdopen(os.open(page, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(f'<!doctype html><title>stickslip lab</title><meta http-equiv="refresh" content="0; url={address}">')
    return page


def serve(door: socket.socket, *, token: str, opened: Callable[[Path], None]) -> None:
    """Answer at the door until Ctrl-C; `opened` is called with the folder of this run when it does.

    Raises
    ------
    ModelError
        The packages of the extra [lab] are not there.
    """
    try:
        import uvicorn

        from stickslip.lab import server
    except ImportError as error:
        raise ss.errors.ModelError(
            f"the lab needs the package {error.name}",
            "it comes with the extra [lab]",
            'pip install ".[lab]" in the checkout',
        ) from error

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started:
                opened(app.state.data.folder)

    app = server.lab_app(token=token, port=door.getsockname()[1])
    settings = uvicorn.Config(
        app, http=server.PatientProtocol, log_level="warning", access_log=False, ws_max_size=LARGEST_MESSAGE,
        server_header=False, date_header=False, timeout_graceful_shutdown=2, ws_per_message_deflate=False,
    )  # fmt: skip
    listener = Server(settings)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, listener.handle_exit)  # a terminal that closes leaves no files behind either
    listener.run(sockets=[door])
