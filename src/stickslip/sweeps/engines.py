"""Where the blocks of a sweep are run: a register of engines."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from stickslip.errors import ModelError
from stickslip.sweeps.cluster import on_cluster
from stickslip.sweeps.cuda import cuda
from stickslip.sweeps.plan import Keep, Plan
from stickslip.sweeps.serial import serial
from stickslip.sweeps.threads import threads

Engine = Callable[[Plan, Sequence[int], Keep, str | None], None]
ENGINES: dict[str, Engine] = {"serial": serial, "threads": threads, "dask": on_cluster, "cuda": cuda}


def read_engine(name: str) -> tuple[Engine, str | None]:
    """The engine of a name, and the address behind "://" where there is one.

    Raises
    ------
    ModelError
        No engine has that name.
    """
    word, _, address = name.partition("://")
    if word not in ENGINES:
        raise ModelError(f"no engine is called '{word}'", f"there are {', '.join(ENGINES)}", "choose one of them")
    return ENGINES[word], address or None
