"""How long the lab waits for the rest of a request, and for how many at a time: half a request costs nobody else."""

from __future__ import annotations

import asyncio
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

PATIENCE = 10.0  # s from a connection's opening, or its last answer, to the end of the next request's head
MOST = 256  # connections without a request at work that may take that long; a page keeps six, so some forty pages
HURRY = 3.0  # s for those that come when there are more: an honest one sends its head as soon as it is open,
# but on a busy machine even that was seen to take more than a second


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
