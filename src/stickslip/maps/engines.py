"""Where the blocks of a sweep are run: a register of engines.

``serial`` is the engine to which the others are held. On a Dask cluster workers that die are replaced, and their blocks
run again.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from logging import CRITICAL
from threading import Event
from typing import TYPE_CHECKING, Any

from stickslip.errors import ModelError, SolveError
from stickslip.maps.crowd import run_block
from stickslip.maps.plan import Keep, Plan, required
from stickslip.solve.refusal import ended_by
from stickslip.workers import processors, unheard

if TYPE_CHECKING:
    from distributed import Client

Engine = Callable[[Plan, Sequence[int], Keep, str | None], None]

AHEAD = 4  # blocks in flight a thread of a cluster: enough to hide the way, few enough to keep memory flat
PATIENCE = 10  # s to wait for a scheduler
DEATHS = 10  # workers that may die of one block


def serial(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None = None) -> None:
    """Run the blocks in turn."""
    for number in numbers:
        keep(number, *run_block(plan, number))


def threads(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None = None) -> None:
    """Run the blocks on as many threads as there are processors, or as `address` says; keep each in this thread.

    The kernels let go of Python's lock while they march. No more blocks are under way than twice the threads, so that
    memory stays flat; on an interrupt those that are not done are dropped.
    """
    count, ended = int(address) if address else processors(), Event()

    left = iter(numbers)
    with ThreadPoolExecutor(count, "sweep", ended_by, (ended,)) as pool:
        running = {pool.submit(run_block, plan, number): number for number in islice(left, 2 * count)}
        try:
            while running:
                for task in wait(running, return_when=FIRST_COMPLETED).done:
                    keep(running.pop(task), *task.result())
                    running |= {pool.submit(run_block, plan, number): number for number in islice(left, 1)}
        except KeyboardInterrupt:
            ended.set()
            for task, number in running.items():
                if not task.cancel() and task.exception() is None:
                    keep(number, *task.result())
            raise


def on_gpu(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None = None) -> None:
    """Run the blocks in turn on an NVIDIA GPU, one motion to a thread; raises as :func:`stickslip.maps.cuda.run`."""
    try:
        from stickslip.maps.cuda import run  # numba-cuda is an extra
    except ImportError as absent:
        raise ModelError(
            "numba-cuda is not installed", "a GPU is driven by numba-cuda", 'pip install ".[gpu]" in the checkout'
        ) from absent
    run(plan, numbers, keep)


def on_cluster(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None) -> None:
    """Run blocks on the Dask cluster whose scheduler is at `address`, or on one made of this machine's cores."""
    from distributed import KilledWorker, as_completed

    with client_of(address) as client:
        shared = client.scatter(plan, broadcast=True)
        waiting = iter(numbers)

        def send(count: int) -> list[Any]:
            return [client.submit(_run, shared, number, pure=False) for number in islice(waiting, count)]

        count = max(1, sum(client.nthreads().values()))
        running = as_completed(send(AHEAD * count))
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


@contextmanager
def client_of(address: str | None) -> Iterator[Client]:
    """A cluster of one's own, or the one that stands at an address."""
    dask, distributed = required("dask"), required("distributed")
    if address is None:
        with (
            dask.config.set({"distributed.scheduler.allowed-failures": DEATHS}),
            distributed.LocalCluster(
                threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=CRITICAL
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            client.run(unheard)
            yield client
        return
    _require_port(address)
    try:
        client = distributed.Client(f"tcp://{address}", timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise _unanswered(address, f"it is asked for {PATIENCE} s") from error
    with client:
        yield client


def _require_port(address: str) -> None:
    """Refuse an address whose port is closed at once: the client of a scheduler goes on asking."""
    host, _, port = address.rpartition(":")
    if not (host and port.isdecimal()):
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=PATIENCE).close()
    except ConnectionRefusedError as error:
        raise _unanswered(address, "its port is closed") from error
    except (OSError, OverflowError):
        return  # the client says what is the matter


def _unanswered(address: str, how: str) -> ModelError:
    step = "start one there with `dask scheduler`, or leave the address for a cluster of this machine"
    return ModelError(f"no Dask scheduler answers at {address}", how, step)


ENGINES: dict[str, Engine] = {"serial": serial, "threads": threads, "dask": on_cluster, "cuda": on_gpu}
ADDRESSES = ("threads", "dask")  # engines with something behind "://": how many, or which scheduler


def read_engine(name: str) -> tuple[Engine, str | None]:
    """The engine of a name, and the address behind "://" where there is one.

    Raises
    ------
    ModelError
        No engine has that name, or what stands behind "://" has no meaning for it.
    """
    word, _, address = name.partition("://")
    if word not in ENGINES:
        raise ModelError(f"no engine is called '{word}'", f"there are {', '.join(ENGINES)}", "choose one of them")
    if address and word not in ADDRESSES:
        raise ModelError(f"engine = '{name}'", f"{word} has no address", f"write '{word}'")
    if address and word == "threads" and not (address.isdecimal() and int(address)):
        raise ModelError(f"engine = '{name}'", "behind threads:// stands their number", "write 'threads://4'")
    return ENGINES[word], address or None
