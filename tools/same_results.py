"""Whether two checkouts give the same results: ``python tools/same_results.py BEFORE AFTER`` lists what differs.

Asked are the known answers of every scenario, the bundled record, and each file under STICKSLIP_DATA that reads without
a word about its columns: its samples, what the check-up finds, and every number of an analysis. A question that is
refused counts by its sentence. Numbers are the same within 1e-12 of the larger.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

RELATIVE = 1e-12
ROWS = (0, 20_000)  # of a file
ASKED = {
    "forced": lambda ss, record: ss.analyze(record, mass=2.42, stiffness=2310.0),
    "decay": lambda ss, record: ss.analyze_decay(record),
    "squeak": lambda ss, record: ss.analyze_squeaks(record),
}


def results() -> Iterator[tuple[str, Any]]:
    """Every result of the package that is imported, by what was asked."""
    import stickslip as ss

    for name in ss.scenarios.names():
        yield (
            name,
            asked(lambda name=name: {k: plain(v) for k, v in ss.scenarios.answers(ss.scenarios.get(name)).items()}),
        )
    records = {"demo": ss.datasets.demo}
    for path in sorted(Path(os.environ.get("STICKSLIP_DATA", "nowhere")).rglob("*")):
        if path.is_file() and path.suffix != ".md":
            records[path.name] = lambda path=path: ss.read_record(path, rows=ROWS)
    for name, read in records.items():
        try:
            record = read()
        except (ss.errors.StickslipError, OSError) as error:
            yield f"{name}: read", str(error)
            continue
        sums = [float(np.nansum(np.abs(record[channel]))) for channel in record]
        yield f"{name}: read", [*record, len(record), record.fs, *sums, *map(str, record.check())]
        for question, answer in ASKED.items():
            yield f"{name}: {question}", asked(lambda answer=answer, record=record: estimates(answer(ss, record)))


def asked(question: Callable[[], Any]) -> Any:
    """The answer, or why there is none."""
    from stickslip.errors import StickslipError

    try:
        return question()
    except StickslipError as error:
        return str(error)


def estimates(findings: Any) -> list[Any]:
    return [
        [estimate.name, estimate.value, *estimate.interval, str(estimate.status)] for estimate in findings.estimates
    ]


def plain(value: Any) -> Any:
    """As JSON has it."""
    if isinstance(value, complex | np.complexfloating):
        return [value.real, value.imag]
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def same(one: Any, other: Any) -> bool:
    """Whether two answers are equal, numbers but for rounding."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=RELATIVE) or (math.isnan(one) and math.isnan(other))
    return bool(one == other)


def of(checkout: Path) -> dict[str, Any]:
    """The results of a checkout, in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src")}
    run = subprocess.run(
        [sys.executable, "-W", "ignore", __file__], env=environment, stdout=subprocess.PIPE, check=True, text=True
    )
    return dict(json.loads(line) for line in run.stdout.splitlines())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("checkouts", nargs="*", type=Path, help="two; none prints the results of what is imported")
    given = parser.parse_args().checkouts
    if not given:
        for key, answer in results():
            print(json.dumps([key, answer], default=str), flush=True)
        return
    before, after = (of(checkout.resolve()) for checkout in given)
    keys = dict.fromkeys([*before, *after])
    differing = [key for key in keys if not same(before.get(key), after.get(key))]
    for key in differing:
        print(key, before.get(key), after.get(key), sep="\n  ")
    print(f"{len(keys) - len(differing)} of {len(keys)} results are the same within {RELATIVE:g}")
    sys.exit(bool(differing))


if __name__ == "__main__":
    main()
