"""Mutate small whole files of every format, read and check up each, and count how that ends.

    python tools/mutate_files.py 20000 --seed 1

Each batch has a process of its own with a limit of memory, each file a limit of time. An end is a record, a refusal in
one sentence, or a defect: any other exception, a warning, a process that dies, more memory or more time. The files that
are defects are kept in a folder and named; the exit code is 1 where there is one.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from multiprocessing.connection import Connection
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

BATCH = 250  # files of one process: few enough that one file's memory is not lost among those before it
SECONDS, BYTES = 20.0, 1_000_000_000
ADDRESSES = 4 * BYTES  # what may be reserved: threads' stacks and arenas are, and are never touched
NUMBERS = [
    b"\xff" * 4,
    b"\xff" * 8,
    b"\0" * 8,
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"99999999999",
    b"1e308",
    b"-1",
    b"[",
]

End = tuple[int, str, str, float, int]  # number, outcome, words, seconds, bytes at the peak


def mutated(whole: dict[str, bytes], seed: int, number: int) -> tuple[str, bytes]:
    """The name of a file and its bytes, with a few places changed: the same for the same seed and number."""
    draw = random.Random(f"{seed} {number}")
    name = draw.choice(sorted(whole))
    data = bytearray(whole[name])
    near = draw.choice([200, 2000, len(data)])
    for _ in range(draw.choice([1, 1, 2, 3, 8])):
        at = draw.randrange(max(1, min(near, len(data))))
        piece = draw.choice([draw.randbytes(draw.randrange(1, 9)), draw.choice(NUMBERS)])
        match draw.choice(["set", "flip", "insert", "delete", "repeat", "move"]):
            case "set":
                data[at : at + len(piece)] = piece
            case "flip":
                data[at : at + 1] = bytes([(data[at : at + 1] or b"\0")[0] ^ 1 << draw.randrange(8)])
            case "insert":
                data[at:at] = piece
            case "delete":
                del data[at : at + draw.randrange(1, 200)]
            case "repeat":
                data[at:at] = data[at : at + draw.randrange(1, 400)] * draw.randrange(1, 20)
            case "move":
                data[at : at + 64] = data[draw.randrange(len(data) or 1) :][:64]
    if draw.random() < 0.25:
        del data[draw.randrange(len(data) + 1) :]
    return name, bytes(data)


def ended(path: Path, clockless: bool) -> tuple[str, str]:
    """How reading and checking up a file ends, and in which words."""
    import stickslip as ss

    try:
        ss.read_record(path, fs=250 if clockless else None).check()
    except ss.StickslipError as error:
        words = str(error)
        return (
            ("refusal", "") if "\n" not in words and len(words) < 1500 else ("defect", f"the sentence: {words[:200]}")
        )
    except MemoryError:
        return "defect", "MemoryError"
    except Exception as error:  # noqa: BLE001 - whatever is left is what is looked for
        return "defect", f"{type(error).__name__}: {error}"[:200]
    return "record", ""


def batch(ends: Connection, whole: dict[str, bytes], seed: int, numbers: range, clockless: set[str]) -> None:
    """Send the end of each file of a batch; runs in a process of its own."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            name, data = mutated(whole, seed, number)
            path = Path(folder) / name
            path.write_bytes(data)
            began = time.perf_counter()
            outcome, words = ended(path, name in clockless)
            seconds = time.perf_counter() - began
            path.unlink()
            ends.send((number, outcome, words, seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024))


def ends_of(whole: dict[str, bytes], seed: int, count: int, clockless: set[str]) -> list[End]:
    """The end of every file; a process that dies, or does not answer, costs the one file that it was at."""
    forks = multiprocessing.get_context("forkserver")
    forks.set_forkserver_preload(
        ["stickslip.files.read", "pandas", "scipy.io", "pyarrow.parquet", "h5py", "nptdms", "pyuff"]
    )
    found: list[End] = []
    while len(found) < count:
        first = len(found)
        numbers = range(first, min(first + BATCH, count))
        here, there = forks.Pipe(duplex=False)
        process = forks.Process(target=batch, args=(there, whole, seed, numbers, clockless))
        process.start()
        there.close()
        for number in numbers:
            try:
                answers = here.poll(SECONDS + 10 * (number == first))  # the first waits for the process to start
                found.append(here.recv() if answers else (number, "defect", f"no answer in {SECONDS:g} s", SECONDS, 0))
            except EOFError:
                answers = False
                found.append((number, "defect", "the process died", 0.0, 0))
            if not answers:
                break
        process.kill()
        process.join()
        print(f"{len(found)} of {count}", end="\r", file=sys.stderr, flush=True)
    return [_weighed(end) for end in found]


def _weighed(end: End) -> End:
    number, outcome, _, seconds, peak = end
    if outcome != "defect" and (seconds > SECONDS or peak > BYTES):
        return number, "defect", f"{seconds:.1f} s, {peak / 1e6:.0f} MB", seconds, peak
    return end


def main() -> int:
    """Mutate, count, print."""
    from test_hostile_files import CLOCKLESS, FILES

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path("defects"), help="folder for the files that are defects")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name, write in FILES.items():
            write(Path(folder) / name)
        whole = {name: (Path(folder) / name).read_bytes() for name in FILES}
    ends = ends_of(whole, asked.seed, asked.count, CLOCKLESS)
    counts = Counter(end[1] for end in ends)
    print(f"{len(ends)} mutated files of {len(whole)} kinds, seed {asked.seed}")
    for outcome in ("record", "refusal", "defect"):
        print(f"{outcome:8} {counts[outcome]:6}")
    slowest, largest = max(ends, key=lambda end: end[3]), max(ends, key=lambda end: end[4])
    print(f"worst time   {slowest[3]:.2f} s, file {slowest[0]} ({mutated(whole, asked.seed, slowest[0])[0]})")
    print(f"worst memory {largest[4] / 1e6:.0f} MB, in a process of {BATCH} files at most")
    for number, outcome, words, *_ in ends:
        if outcome == "defect":
            name, data = mutated(whole, asked.seed, number)
            asked.keep.mkdir(exist_ok=True)
            (asked.keep / f"{number}-{name}").write_bytes(data)
            print(f"file {number} ({name}): {words}")
    return int(counts["defect"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
