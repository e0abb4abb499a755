"""What an environment must be able to do, in one process: the program's jobs, and a record in every format.

Run by smoke.py inside the environments that it makes; it needs the package with its extras, nothing of the checkout.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

import stickslip as ss
from stickslip import datasets
from stickslip.cli.program import main

SAME = 1e-3  # of the friction by another format: the same numbers in a text of 6 digits
SLIDER = """
system = { mass = 2.42, stiffness = "2.31 N/mm", damping = 0.12 }
law = { name = "Coulomb", kinetic = 1.1 }
drive = { name = "HarmonicBase", amplitude = "0.65 mm", frequency = 2.5 }
"""
GRID = """
system = "slider.toml"
measures = ["stops", "amplitude"]
cycles = 4
settle = 40
[grid]
frequency = { from = "2 Hz", to = 9, points = 4 }
kinetic = ["200 mN", 1.2]
"""


def stickslip(*words: object) -> str:
    """What the program prints; its end with another code than 0 ends this process."""
    begun, command = time.perf_counter(), f"stickslip {' '.join(map(str, words))}"
    outcome = CliRunner().invoke(main, [str(word) for word in words])
    if outcome.exit_code:
        sys.exit(f"{command} ended with {outcome.exit_code}\n{outcome.output}{outcome.exception!r}")
    print(f"  {time.perf_counter() - begun:5.1f} s  {command}"[:118], flush=True)
    return outcome.output


# ---- a record in every format


def write_text(path: Path, record: ss.Record) -> None:
    rows = np.column_stack([record.time, record.samples["x"], record.samples["z"]])
    np.savetxt(path, rows, delimiter="\t", header="t [s]\tx [m]\tz [m]", comments="")


def write_lvm(path: Path, record: ss.Record) -> None:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
        "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n***End_of_Header***\t\n\t\n"
        f"Channels\t2\t\t\nSamples\t{len(record.time)}\t{len(record.time)}\t\nY_Unit_Label\tm\tm\t\n"
        f"X_Dimension\tTime\tTime\t\nX0\t0\t0\t\nDelta_X\t{1 / record.fs}\t{1 / record.fs}\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tx\tz\tComment\n"
    )
    rows = zip(record.time, record.samples["x"], record.samples["z"], strict=True)
    path.write_text(head + "".join(f"{t:.6f}\t{x:.9e}\t{z:.9e}\n" for t, x, z in rows))


def write_mat5(path: Path, record: ss.Record) -> None:
    from scipy.io import savemat

    savemat(path, {"t": record.time, **record.samples})


def write_mat73(path: Path, record: ss.Record) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": record.time, **record.samples}.items():
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_tdms(path: Path, record: ss.Record) -> None:
    from nptdms import ChannelObject, TdmsWriter

    about = {"wf_increment": 1 / record.fs, "wf_samples": len(record.time), "unit_string": "m"}
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("rig", name, values, about) for name, values in record.samples.items()])


def write_uff(path: Path, record: ss.Record) -> None:
    import pyuff

    sets = [
        pyuff.prepare_58(
            binary=0,
            func_type=1,
            rsp_node=1,
            rsp_dir=1,
            ref_dir=0,
            ref_node=0,
            data=values,
            x=record.time,
            id1=name,
            rsp_ent_name=name,
            ref_ent_name="NONE",
            abscissa_spacing=1,
            abscissa_spec_data_type=17,
            abscissa_axis_units_lab="s",
            ordinate_spec_data_type=8,
            ordinate_axis_units_lab="m",
            orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
        )
        for name, values in record.samples.items()
    ]
    pyuff.UFF(str(path)).write_sets(sets, mode="add")


def write_sound(path: Path, record: ss.Record) -> None:
    import soundfile

    subtype = "DOUBLE" if path.suffix == ".wav" else "PCM_24"
    soundfile.write(path, 100 * np.column_stack([*record.samples.values()]), round(record.fs), subtype=subtype)


def write_json(path: Path, record: ss.Record) -> None:
    columns: dict[str, Any] = {name: values.tolist() for name, values in record.samples.items()}
    path.write_text(json.dumps({"fs": record.fs, "units": {"x": "m", "z": "m"}, **columns}))


METRES = ("--channels", "x=x [m]", "--channels", "z=z [m]")
GROUP = ("--channels", "x=rig/x [m]", "--channels", "z=rig/z [m]")
SOUND = ("--channels", "x=ch1 * 0.01 [m]", "--channels", "z=ch2 * 0.01 [m]")
FORMATS: dict[str, tuple[Callable[[Path, ss.Record], object], tuple[str, ...]]] = {
    "run.csv": (lambda path, record: ss.write_record(record, path), ()),
    "run.h5": (lambda path, record: ss.write_record(record, path), ()),
    "run.parquet": (lambda path, record: ss.write_record(record, path), ()),
    "run.txt": (write_text, ()),
    "run.lvm": (write_lvm, ()),
    "run.json": (write_json, ()),
    "five.mat": (write_mat5, METRES),
    "seven.mat": (write_mat73, METRES),
    "run.tdms": (write_tdms, GROUP),
    "run.uff": (write_uff, ()),
    "run.wav": (write_sound, SOUND),
    "run.flac": (write_sound, SOUND),
}


def every_format(folder: Path) -> None:
    """A record analysed from each format: the same friction, whatever it was written in."""
    demo = datasets.demo().between(0, 4)
    record = ss.Record.of({name: demo.samples[name] for name in "xz"}, fs=demo.fs, units={"x": "m", "z": "m"})
    rig = [word for name in ("mass", "stiffness", "damping") for word in (f"--{name}", str(demo.truth[name]))]
    friction: dict[str, float] = {}
    for name, (write, options) in FORMATS.items():
        write(folder / name, record)
        answer = json.loads(stickslip("analyze", folder / name, *options, *rig, "--json"))
        values = {estimate["name"]: estimate["value"] for estimate in answer["estimates"]}
        friction[name] = values["sliding friction"]
    for name, value in friction.items():
        if abs(value - friction["run.csv"]) > SAME * friction["run.csv"]:
            sys.exit(f"the friction of {name} is {value}, that of run.csv {friction['run.csv']}")
    if abs(friction["run.csv"] - demo.truth["sliding friction"]) > 0.05:
        sys.exit(f"the friction is {friction['run.csv']}, the truth {demo.truth['sliding friction']}")


# ---- the program's jobs


def every_job(folder: Path) -> None:
    """Each command that makes something, small."""
    (folder / "slider.toml").write_text(SLIDER)
    (folder / "grid.toml").write_text(GRID)
    stickslip("demo", "--output", folder / "demo")
    stickslip("simulate", folder / "slider.toml", "--cycles", 12, "--format", "h5", "--output", folder / "run")
    for _ in range(2):  # the second takes all from the store
        stickslip("sweep", folder / "grid.toml", "--store", folder / "map.zarr", "--output", folder / "map")
    squeak(folder)
    decay(folder)
    for page in ("demo", "run", "map", "squeak", "decay"):
        made = sorted(path.name for path in (folder / page).iterdir())
        if "results.json" not in made:
            sys.exit(f"no results in {page}: {made}")


def squeak(folder: Path) -> None:
    """A tone of 500 Hz with its harmonics for 0.4 s, in noise."""
    time = np.arange(10_000) / 10_000.0
    inside = np.exp(-((np.maximum(0, np.abs(time - 0.5) - 0.2) / 0.01) ** 2))
    tone = sum(np.sin(2 * np.pi * order * 500 * time) / order**2 for order in (1, 2, 3))
    sound = inside * tone + 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    ss.write_record(ss.Record.of({"sound": sound}, fs=10_000.0, units={"sound": "Pa"}), folder / "squeal.csv")
    stickslip("squeak", folder / "squeal.csv", "--output", folder / "squeak")


def decay(folder: Path) -> None:
    """Half-cycles that lose a fixed amount each: dry friction alone."""
    released = ss.Oscillator(mass=1.0, stiffness=400.0, law=ss.laws.Coulomb(0.2))
    run = ss.simulate(released, start={"x": 0.01}, duration=5.0)
    ss.write_record(
        ss.Record.of({"x": run.record(fs=500.0).samples["x"]}, fs=500.0, units={"x": "m"}), folder / "release.csv"
    )
    stickslip("decay", folder / "release.csv", "--method", "thesis", "--mass", 1.0, "--output", folder / "decay")


if __name__ == "__main__":
    place = Path(sys.argv[1])
    every_format(place)
    every_job(place)
