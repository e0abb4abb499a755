"""Recording: nothing is lost that came, whatever ends the program; what did not come is named."""

from __future__ import annotations

import math
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from bench_devices import Counter, Counting, counts
from stickslip.bench import Block, Fault, Sim, Tape, Tone, Trigger, Wanted, acquire
from stickslip.bench.recording import Awaited
from stickslip.cli.program import main
from stickslip.files import journal

ROOT = Path(__file__).parent

KILLED = """
import sys
from bench_devices import Counter
from stickslip.bench import Wanted, acquire
acquire(Counter(size=200, pace=1.0), output=sys.argv[1], watch=lambda device, block: print(block.first, flush=True))
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal here")
def test_a_kill_costs_the_last_block_alone(tmp_path: Path) -> None:
    """Killed at instants that nobody chose, three at once: all that was read before the last block is there."""
    chance = random.Random(4)
    paths = [tmp_path / f"{number}.h5" for number in range(3)]
    runs = [
        subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, cwd=ROOT) for path in paths
    ]
    for run, path in zip(runs, paths, strict=True):
        assert run.stdout is not None
        for _ in range(chance.randrange(3, 120)):
            run.stdout.readline()
        threading.Event().wait(chance.random() * 0.01)
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        rest = [int(line) for line in run.stdout.read().split()]
        run.stdout.close()
        read = rest[-1] if rest else 0  # the counter of the block that came last
        assert not path.exists()
        record = ss.read_record(path.with_name(f"{path.name}.journal"))
        assert len(record) >= read
        np.testing.assert_array_equal(record["c1"], counts(0, len(record), 2)[1] * 1e-6)
        assert "not closed" in record.history[-1].outcome


def test_what_is_recorded_is_what_was_sent(tmp_path: Path) -> None:
    done = acquire(Counter(channels=3), output=tmp_path / "run.h5", wanted=Wanted(seconds=1.00501))
    record = ss.read_record(done.paths[0])
    assert len(record) == 50_251
    for row, name in zip(counts(0, len(record), 3), record, strict=True):
        np.testing.assert_array_equal(record[name], row * 1e-6)
    assert [*tmp_path.iterdir()] == [tmp_path / "run.h5"]
    told = record.history[0].arguments
    assert (told["device"], told["model"], told["serials"]["c2"]) == ("counter", "counts, serial 0815", "S2")
    assert told["ranges"] == {"c0": 0.015, "c1": 0.015, "c2": 0.015}
    assert ss.read_record(done.paths[0]).equals(record)
    again = ss.write_record(record, tmp_path / "again.h5")
    assert ss.read_record(again).equals(record)


def test_what_is_lost_or_clipped_is_named(tmp_path: Path) -> None:
    done = acquire(Counter(lost=((3000, 5000), (9000, 9200))), output=tmp_path / "a.h5", wanted=Wanted(seconds=0.4))
    record = ss.read_record(done.paths[0])
    missing = np.flatnonzero(np.isnan(record["c0"]))
    assert missing.tolist() == [*range(3000, 5000), *range(9000, 10_000)]  # a block is lost whole
    np.testing.assert_array_equal(record["c0"][5000:9000], counts(5000, 9000, 1)[0] * 1e-6)
    assert "3000 samples lost (2000 at 0.060 s, 1000 at 0.180 s)" in record.history[-1].outcome
    sim = Sim(fast=True, faults=(Fault("saturation", 0.5, 0.1, "load"),))
    done = acquire(sim, output=tmp_path / "b.csv", wanted=Wanted(seconds=1.0))
    record = ss.read_record(done.paths[0])
    clipped = np.sum(np.abs(record["load"]) >= sim.inputs[3].limit * (1 - 1e-9))
    assert clipped > 300
    assert f"load clipped in {clipped} samples, first at 0.5" in done.outcomes["sim"]


def test_samples_that_are_lost_at_the_end_are_named_too(tmp_path: Path) -> None:
    done = acquire(Counter(lost=((15_000, 40_000),)), output=tmp_path / "a.h5", wanted=Wanted(seconds=0.4))
    assert "5000 samples lost (5000 at 0.300 s)" in done.outcomes["counter"]
    assert len(ss.read_record(tmp_path / "a.h5")) == 15_000


def test_a_disk_without_room_for_the_record_leaves_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output, rich = tmp_path / "a.h5", shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: rich._replace(free=200_000))
    with pytest.raises(ss.errors.FormatError, match=r"a\.h5.* MB are free.*a\.h5\.journal holds all of it") as refused:
        acquire(Counter(), output=output, wanted=Wanted(seconds=0.4))
    assert "make room" in refused.value.next_step
    monkeypatch.undo()
    assert not output.exists()
    assert len(ss.read_record(tmp_path / "a.h5.journal")) == 20_000


LIMITED = """
import resource, sys
from bench_devices import Counter
from stickslip.bench import Wanted, acquire
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    acquire(Counter(), output=sys.argv[1], wanted=Wanted(seconds=0.4))
except Exception as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files here")
def test_a_disk_that_fills_while_the_record_is_written_leaves_the_journal(tmp_path: Path) -> None:
    """HDF5 tells so as it closes the file, by an error that is no OSError."""
    pytest.importorskip("h5py")
    script = [sys.executable, "-c", LIMITED, str(tmp_path / "a.h5")]
    run = subprocess.run(script, capture_output=True, text=True, cwd=ROOT, check=True)
    assert "'a.h5' can not be written" in run.stdout
    assert "a.h5.journal holds all of it" in run.stdout
    assert not run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5.journal"]
    assert len(ss.read_record(tmp_path / "a.h5.journal")) == 20_000


INTERRUPTED_TWICE = """
import signal, sys, time
from stickslip.bench import recording, tape
from stickslip.cli.program import main

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs are born deaf to it
moment, written, keep = sys.argv[1], tape.write_record, tape.Tape.write

def wait(word):
    print(word, flush=True)
    time.sleep(600)

def write(record, path, **options):
    if moment == "before":
        wait("writing")
    written(record, path, **options)
    wait("written")

def kept(one, block):
    keep(one, block)
    if block.first > 4000:
        wait("recording")

tape.write_record, tape.Tape.write = write, kept
main(["acquire", "--device", "sim", "--output", sys.argv[2]])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process alone")
@pytest.mark.parametrize("moment", ["before", "behind"])
def test_a_second_ctrl_c_while_the_record_is_written_loses_nothing(tmp_path: Path, moment: str) -> None:
    """It said that nothing was written, of a record that was whole or a journal that could be made one."""
    run = [sys.executable, "-c", INTERRUPTED_TWICE, moment, "a run.csv"]
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        assert process.stdout is not None
        for word in ("recording", "writing" if moment == "before" else "written"):
            assert process.stdout.readline() == f"{word}\n"
            process.send_signal(signal.SIGINT)
        _, said = process.communicate()
    assert process.returncode == 130
    if moment == "before":
        command = "stickslip convert 'a run.csv.journal' 'a run.csv'"
        assert said == f"stickslip: interrupted; a run.csv.journal holds what came: {command} makes a record of it.\n"
        convert = ["convert", str(tmp_path / "a run.csv.journal"), str(tmp_path / "a run.csv")]
        assert CliRunner().invoke(main, convert).exit_code == 0
    else:
        assert said == "stickslip: interrupted; a run.csv is whole.\n"
    assert len(ss.read_record(tmp_path / "a run.csv")) > 4000


def test_a_trigger_begins_it_and_what_was_before_is_kept(tmp_path: Path) -> None:
    wanted = Wanted(0.5, Trigger("x", 3e-4, before=0.25), {"base": Tone(1e-3, 2.0)})
    still = Sim(system=ss.Oscillator(mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1)), fast=True)
    done = acquire(still, output=tmp_path / "run.h5", wanted=wanted)
    record = ss.read_record(done.paths[0])
    assert (len(record), record.start) == (3000, -0.25)
    row = round(-record.start * record.fs)
    assert record["x"][row - 1] < 3e-4 <= record["x"][row]
    assert np.all(record["x"][:row] < 3e-4)
    with pytest.raises(ss.errors.ModelError, match="the inputs are x, z, a, load"):
        acquire(still, output=tmp_path / "other.h5", wanted=Wanted(trigger=Trigger("y", 1.0)))


def test_a_trigger_that_does_not_come_is_waited_for_so_long_and_no_longer(tmp_path: Path) -> None:
    """The counter reads -15 mm and rises by 3 um a sample, from 50 000 samples a second."""
    told: list[tuple[str, float]] = []
    wanted = Wanted(1.0, Trigger("c0", 14.9e-3, timeout=0.1))
    said = r"c0 read -0.015 to -3e-06 m in 0.1 s; .* c0 rising through 0.0149 m; .*nothing was written"
    with pytest.raises(ss.errors.RecordError, match=said):
        acquire(
            Counter(),
            output=tmp_path / "run.h5",
            wanted=wanted,
            progress=lambda words, share: told.append((words, share)),
        )
    assert not [*tmp_path.iterdir()]
    assert told[1] == ("waiting for c0 rising through 0.0149: -0.015 to -0.009003 m so far", pytest.approx(0.4))
    with pytest.raises(ss.errors.RecordError, match=r"c0 read -0.015 to -0.009003 m in 0.04 s"):
        acquire(Counter(last=2000), output=tmp_path / "run.h5", wanted=wanted)
    wanted = Wanted(0.1, Trigger("c0", -0.012, timeout=0.1))
    done = acquire(Counter(), output=tmp_path / "run.h5", wanted=wanted, progress=lambda *stage: told.append(stage))
    assert (len(ss.read_record(done.paths[0])), told[-1]) == (5000, ("recording, 0.1 s", 1.0))
    with pytest.raises(ss.errors.ModelError, match=r"a trigger at 0.02 m; c0 reads 0.015 m at most"):
        acquire(Counter(), output=tmp_path / "other.h5", wanted=Wanted(trigger=Trigger("c0", 0.02)))


class Broken(Counting):
    """Interrupted at its third block."""

    def read(self, timeout: float = 1.0) -> Block | None:
        if self.sent >= 2 * self.device.size:
            raise KeyboardInterrupt
        return super().read(timeout)


def test_an_interruption_ends_the_wait_for_a_trigger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Counter, "open", lambda device: Broken(device))
    with pytest.raises(KeyboardInterrupt):
        acquire(Counter(), output=tmp_path / "run.h5", wanted=Wanted(trigger=Trigger("c0", 0.0)))
    assert not [*tmp_path.iterdir()]


def test_a_reading_that_is_not_there_hides_no_trigger() -> None:
    """Neither within a block, nor as the last of one, nor before the first that is there."""
    awaited = Awaited(Trigger("x", 1.0), Sim(fast=True))
    nan = math.nan
    rows = [[nan, 2.0, 0.5, nan], [1.5, 0.5, 0.5, nan], [nan, nan, 1.0, 2.0]]
    blocks = [Block(4 * at, 0.0, np.array([row] * 4)) for at, row in enumerate(rows)]
    assert [awaited.look(block) for block in blocks] == [None, 4, 10]


def test_less_before_a_trigger_than_was_wanted_is_told(tmp_path: Path) -> None:
    moved = {"base": Tone(1e-3, 2.0)}
    for before, notes in ((10.0, 1), (0.0, 0)):
        wanted = Wanted(0.2, Trigger("x", 3e-4, before=before), moved)
        done = acquire(Sim(fast=True), output=tmp_path / f"{before}.h5", wanted=wanted)
        kept = -ss.read_record(done.paths[0]).start
        assert len(done.notes) == notes
        assert all(f"kept {kept:.3g} s before the trigger, not 10 s" in note for note in done.notes)
        told = ss.read_record(done.paths[0]).history[0].arguments["trigger"]
        assert told == f"x rising through 0.0003, {abs(kept):.4g} s before it kept"


def test_a_folder_that_is_not_there_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    with pytest.raises(ss.errors.ModelError, match="no folder"):
        acquire(Sim(fast=True), output=tmp_path / "nowhere" / "run.h5", wanted=Wanted(0.2))


def test_two_devices_come_onto_one_clock(tmp_path: Path) -> None:
    """The second unit begins 40 ms later on its clock, which is 200 ppm fast; both see x."""
    drive = ss.drives.MultiTone([(6e-4, 2.3, 0.0), (4e-4, 3.1 * 2**0.5, 1.0)])
    system = ss.Oscillator(mass=2.42, stiffness=2310, law=ss.laws.Coulomb(0.4), drive=drive)
    first = Sim(system, rig=ss.Rig.perfect("x", "z"), fs=500.0, fast=True, name="one")
    other = Sim(system, rig=ss.Rig(ss.Rig.perfect("x", "a").sensors, 0.04, 2e-4), fs=400.0, fast=True, name="two")
    done = acquire([first, other], output=tmp_path / "run.h5", wanted=Wanted(seconds=8.0))
    record = ss.read_record(done.paths[0])
    assert set(record) == {"x", "z", "a", "x_b"}
    inner = slice(200, -200)
    apart = np.abs(record["x"] - record["x_b"])[inner].max()
    assert apart < 2e-3 * np.abs(record["x"]).max()
    assert [*tmp_path.iterdir()] == [tmp_path / "run.h5"]


def test_a_folder_that_is_gone_at_the_end_is_one_sentence(tmp_path: Path) -> None:
    folder = tmp_path / "stick"
    folder.mkdir()
    tape = Tape(Counter(), folder / "run.h5")
    tape.write(Block(0, 0.0, counts(0, 1000, 2)))
    tape.close()
    kept = (folder / "run.h5.journal").rename(tmp_path / "run.h5.journal")
    tape.path = kept
    folder.rmdir()
    with pytest.raises(ss.errors.FormatError, match=r"can not be written.*run\.h5\.journal holds all of it"):
        tape.finish()
    assert len(ss.read_record(kept)) == 1000


def test_a_mark_stands_in_the_history(tmp_path: Path) -> None:
    device = Counter()
    tape = Tape(device, tmp_path / "run.h5")
    for first in (500, 1500):
        tape.write(Block(first, 0.0, counts(first, first + 1000, 2)))
        tape.mark(f"after {first}")
    assert tape.close() == "2000 samples at 50000 Hz"
    record = ss.read_record(tape.finish())
    marks = [(step.arguments["time"], step.outcome) for step in record.history if step.action == "mark"]
    assert marks == [(0.02, "after 500"), (0.04, "after 1500")]


@pytest.mark.parametrize(
    ("factor", "told"), [(1.0, ""), (1.03, ""), (0.5, "came at 25000 Hz"), (2.0, "came at 100000 Hz")]
)
def test_a_rate_that_is_not_the_stated_one_is_named(factor: float, told: str, tmp_path: Path) -> None:
    tape = Tape(Counter(), tmp_path / "run.h5")
    for first in range(0, 400_000, 10_000):
        after = first + 10_000
        tape.write(Block(first, after / 50_000 / factor, counts(first, after, 2)))
    assert ("by this computer's clock" in tape.close()) == bool(told)
    assert told in ss.read_record(tape.finish()).history[-1].outcome


def test_a_computer_that_was_too_late_tells_no_rate(tmp_path: Path) -> None:
    """Samples that it lost while it stood still were followed by the advice to correct the device's rate."""
    tape = Tape(Counter(), tmp_path / "run.h5")
    for first, clock in ((0, 0.2), (10_000, 20.0), (900_000, 20.1)):
        tape.write(Block(first, clock, counts(first, first + 10_000, 2)))
    outcome = tape.close()
    assert "880000 samples lost" in outcome
    assert "clock" not in outcome


def test_a_damaged_journal_is_read_up_to_the_damage_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.h5.journal"
    tape = Tape(Counter(), tmp_path / "run.h5")
    for first in range(0, 10_000, 1000):
        tape.write(Block(first, 0.0, counts(first, first + 1000, 2)))
    tape.close()
    whole = path.read_bytes()
    chance = np.random.default_rng(8)
    lengths = set()
    for _ in range(60):
        data = bytearray(whole[: chance.integers(len(whole))])
        for at in chance.integers(0, max(1, len(data)), chance.integers(3)):
            if at < len(data):
                data[at] ^= int(chance.integers(1, 256))
        path.write_bytes(bytes(data))
        try:
            record = ss.read_record(path)
        except ss.StickslipError:
            lengths.add(0)
            continue
        np.testing.assert_array_equal(record["c1"], counts(0, len(record), 2)[1] * 1e-6)
        lengths.add(len(record))
    assert len(lengths) > 5
    assert journal.recognise(path, journal.MAGIC + b"...")


def test_nothing_is_measured_where_the_record_can_not_be(tmp_path: Path) -> None:
    (tmp_path / "there.h5").write_text("mine")
    for name, said in (("there.h5", "there already"), ("run.xyz", "ends in")):
        with pytest.raises(ss.StickslipError, match=said):
            acquire(Counter(), output=tmp_path / name, wanted=Wanted(seconds=1.0))
    (tmp_path / "left.h5.journal").write_text("of a run that was killed")
    with pytest.raises(ss.errors.FormatError, match=r"left\.h5\.journal"):
        acquire(Counter(), output=tmp_path / "left.h5", wanted=Wanted(seconds=1.0))


class Unplugged(Counting):
    """Its plug is pulled at the third block."""

    def read(self, timeout: float = 1.0) -> Block | None:
        if self.sent >= 2 * self.device.size:
            raise OSError(5, "Input/output error")
        return super().read(timeout)


def test_a_plug_that_is_pulled_is_one_sentence_that_names_what_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Counter, "open", lambda device: Unplugged(device))
    said = r"counter can not be read any more.*Input/output error.*plug.*run\.h5\.journal holds what came until then"
    with pytest.raises(ss.errors.RecordError, match=said):
        acquire(Counter(), output=tmp_path / "run.h5")
    assert len(ss.read_record(tmp_path / "run.h5.journal")) == 2000


def test_a_device_that_is_not_there_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(device: Counter) -> Counting:
        raise ConnectionRefusedError(111, "Connection refused")

    monkeypatch.setattr(Counter, "open", absent)
    with pytest.raises(ss.errors.RecordError, match=r"counter can not be opened.*Connection refused.*check plug"):
        acquire(Counter(), output=tmp_path / "run.h5")
    assert not list(tmp_path.iterdir())


def test_a_counter_that_runs_back_ends_it_and_keeps_what_was(tmp_path: Path) -> None:
    tape = Tape(Counter(), tmp_path / "run.h5")
    tape.write(Block(0, 0.0, counts(0, 1000, 2)))
    with pytest.raises(ss.errors.RecordError, match="counts its samples upwards"):
        tape.write(Block(500, 0.0, counts(500, 1500, 2)))
    assert len(ss.read_record(tmp_path / "run.h5.journal")) == 1000


def test_the_command_records(tmp_path: Path) -> None:
    config = tmp_path / "rig.toml"
    log, device = '[log]\nsurface = "ground steel"\n', '[devices.rig]\nkind = "sim"\nsystem = "FD-4"\nrig = "perfect"\n'
    config.write_text(f"{log}{device}fs = 500\nfast = true\n")
    output = tmp_path / "run.h5"
    run = CliRunner().invoke(
        main, ["acquire", "--device", "rig", "--config", str(config), "--seconds", "2", "--output", str(output)]
    )
    assert run.exit_code == 0, run.output
    record = ss.read_record(output)
    assert len(record) == 1000
    assert record.log is not None
    assert record.log.entries()["surface"] == "ground steel"
    asked = ["acquire", "--device", "rig", "--config", str(config), "--trigger", "x>1", "--timeout", "0.5"]
    late = CliRunner().invoke(main, [*asked, "--output", str(tmp_path / "late.h5")])
    assert (late.exit_code, late.output.count("\n")) == (1, 1)
    assert "in 0.5 s; the recording begins with x rising through 1 m" in late.output
    alone = CliRunner().invoke(main, [*asked[:-4], *asked[-2:], "--output", str(tmp_path / "late.h5")])
    assert (alone.exit_code, "--timeout: it is of a trigger" in alone.output) == (2, True)
    listed = CliRunner().invoke(main, ["devices", "--config", str(config)])
    assert "rig      virtual rig: Oscillator" in listed.output
