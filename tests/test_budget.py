"""The main job keeps within its means: a million samples of four channels in 10 s and 1 GB."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

import stickslip as ss
from scripts import loaded


@pytest.fixture(scope="module")
def benchmarks() -> ModuleType:
    return loaded("benchmarks/run.py")


# The main job takes 2.5 to 3.3 times what pandas, scipy and matplotlib take for a like one, on a busy machine and on a
# quiet one. The long form shows another second of a processor, one in ten; the short one what is of another order.
@pytest.mark.parametrize(("most", "tries"), [(10.0, 1), pytest.param(3.4, 4, marks=pytest.mark.soak)])
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is read from /proc")
def test_a_million_samples_are_analysed_and_drawn_as_fast_as_others_read_and_draw(
    benchmarks: ModuleType, tmp_path: Path, most: float, tries: int
) -> None:
    """Ten seconds on a machine on which the others take three: processor time over theirs, the best of a few tries."""
    record = benchmarks.long_record()
    assert (len(record), len(list(record))) == (1_000_000, 4)
    file = ss.write_record(record, tmp_path / "long.parquet")
    for _ in range(tries):
        run = benchmarks.analyzed(file)
        ratio = run["processor"] / benchmarks.yardstick(file)
        if ratio < most:
            break
    assert ratio < most
    assert run["samples"] == 1_000_000
    assert run["peak"] < 1000
    assert run["level"] == pytest.approx(ss.datasets.demo().truth["sliding friction"], rel=0.01)
