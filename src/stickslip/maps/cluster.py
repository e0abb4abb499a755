"""The blocks of a map on a Dask cluster: workers that die are replaced, and their blocks run again."""

from __future__ import annotations

import signal
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from logging import CRITICAL
from typing import TYPE_CHECKING, Any

from stickslip.errors import ModelError, SolveError
from stickslip.maps.block import run_block
from stickslip.maps.plan import Keep, Plan, required

if TYPE_CHECKING:
    from distributed import Client

AHEAD = 4  # blocks in flight a thread: enough to hide the way, few enough to keep memory flat
PATIENCE = 10  # s to wait for a scheduler
DEATHS = 10  # workers that may die of one block


def on_cluster(plan: Plan, numbers: Sequence[int], keep: Keep, where: str | None) -> None:
    """Run blocks on the cluster whose scheduler is at `where`, or on one made of this machine's cores."""
    from distributed import KilledWorker, as_completed

    with _client(where) as client:
        shared = client.scatter(plan, broadcast=True)
        waiting = iter(numbers)

        def send(count: int) -> list[Any]:
            return [client.submit(_run, shared, number, pure=False) for number in islice(waiting, count)]

        threads = max(1, sum(client.nthreads().values()))
        running = as_completed(send(AHEAD * threads))
        for future in running:
            try:
                done = future.result()
            except KilledWorker as error:
                raise SolveError(
                    "workers of the cluster died of one block again and again",
                    "a block fits its worker",
                    "give the workers more memory, or look in their logs; what is kept stays",
                ) from error
            keep(*done)
            future.release()
            running.update(send(1))


def _run(plan: Plan, number: int) -> tuple[int, Any, Any]:
    return (number, *run_block(plan, number))


def _unheard() -> None:
    """Leave Ctrl-C, which a terminal sends to every process, to the one that asks: it ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _client(where: str | None) -> Iterator[Client]:
    """A cluster of one's own, or the one that stands at an address."""
    dask, distributed = required("dask"), required("distributed")
    if where is None:
        with (
            dask.config.set({"distributed.scheduler.allowed-failures": DEATHS}),
            distributed.LocalCluster(
                threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=CRITICAL
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            client.run(_unheard)
            yield client
        return
    _require_port(where)
    try:
        client = distributed.Client(f"tcp://{where}", timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise _unanswered(where, f"it is asked for {PATIENCE} s") from error
    with client:
        yield client


def _require_port(where: str) -> None:
    """Refuse an address whose port is closed at once: the client of a scheduler goes on asking."""
    host, _, port = where.rpartition(":")
    if not (host and port.isdecimal()):
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=PATIENCE).close()
    except ConnectionRefusedError as error:
        raise _unanswered(where, "its port is closed") from error
    except (OSError, OverflowError):
        return  # the client says what is the matter


def _unanswered(where: str, how: str) -> ModelError:
    step = "start one there with `dask scheduler`, or leave the address for a cluster of this machine"
    return ModelError(f"no Dask scheduler answers at {where}", how, step)
