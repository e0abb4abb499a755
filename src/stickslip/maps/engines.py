"""Where the blocks of a sweep are run: a register of engines."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from stickslip.errors import ModelError
from stickslip.maps.cluster import on_cluster
from stickslip.maps.cuda import cuda
from stickslip.maps.plan import Keep, Plan
from stickslip.maps.serial import serial
from stickslip.maps.threads import threads

Engine = Callable[[Plan, Sequence[int], Keep, str | None], None]
ENGINES: dict[str, Engine] = {"serial": serial, "threads": threads, "dask": on_cluster, "cuda": cuda}
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
