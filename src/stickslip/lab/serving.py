"""The lab listens, on this machine alone."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable
from functools import partial
from pathlib import Path

import stickslip as ss

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


def serve(
    door: socket.socket,
    *,
    token: str,
    opened: Callable[[Callable[[str], Path]], None],
    rig: Path | None = None,
    records: Path | None = None,
) -> None:
    """Answer at the door until Ctrl-C; `opened` is called when it does, with
    what writes a page that leads a browser to an address. `rig` is the file of the rig whose devices may be watched,
    and `records` the folder of recordings.

    Raises
    ------
    ModelError
        The packages of the extra [lab] are not there.
    """
    try:
        import uvicorn

        from stickslip.lab import live, server
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
                opened(partial(server.doorway, app.state.data.folder))

    app = server.lab_app(token=token, port=door.getsockname()[1], place=live.place_of(rig, records))
    settings = uvicorn.Config(
        app,
        http=server.PatientProtocol,
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
