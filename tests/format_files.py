"""A small file of each binary format, with what is in it, and how such files are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pyuff
import scipy.io
import soundfile
from nptdms import ChannelObject, TdmsWriter

from stickslip.files import audio, hdf5, matlab, parquet, tdms, uff
from stickslip.files.table import Options, Table

FORMATS = (matlab, tdms, uff, audio, hdf5, parquet)
Formats = Callable[[str], Path]


def recognised(path: Path) -> ModuleType | None:
    with path.open("rb") as file:
        head = file.read(1 << 16)
    formats = [module for module in FORMATS if module.recognise(path, head)]
    assert len(formats) < 2
    return formats[0] if formats else None


def read(path: Path) -> Table:
    module = recognised(path)
    assert module is not None, path
    return module.read(path, Options())


def whole(table: Table, size: int = 10**7) -> dict[str, np.ndarray]:
    """Every column by itself, so that columns of different length come whole."""
    return {
        column.name: np.concatenate([block[column.name] for block in table.blocks([column.name], size)])
        for column in table.columns
    }


def units(table: Table) -> dict[str, str | None]:
    return {column.name: column.unit for column in table.columns}


# ---- a small file of each format, with what is in it

X = np.random.default_rng(3).standard_normal((400, 2)) * 0.1


def write_tdms(path: Path) -> None:
    waveform = {"wf_increment": 0.01, "wf_start_offset": 0.5, "wf_samples": 200, "unit_string": "mm"}
    with TdmsWriter(path) as writer:
        for part in (X[:200], X[200:]):
            channels = [ChannelObject("Rig", name, part[:, i], waveform) for i, name in enumerate(("x", "z"))]
            writer.write_segment(channels)


def write_mat4(path: Path) -> None:
    scipy.io.savemat(path, {"x": X[:, 0], "z": X[:, 1], "gain": 35.15}, format="4")


def write_mat5(path: Path, compressed: bool = False) -> None:
    content = {"x": X[:, 0], "z": X[:, 1:], "rig": {"both": X, "mass": 2.42}, "gain": 35.15}
    scipy.io.savemat(path, content, do_compression=compressed)


def write_mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("x", X[:, :1]), ("both", X), ("gain", np.array([[35.15]]))):
            file.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=X[:, 0], chunks=(64,), compression="gzip").attrs["units"] = "mm"
        file.create_dataset("group/both", data=X, chunks=(100, 2))
        file.create_dataset("raw", data=np.rec.fromarrays([X[:, 0], X[:, 1]], names="a,b"))
        file["group"].attrs["dt"] = 0.001
        file.attrs["fs"] = 50.0
        file["mass"] = 2.42


def write_parquet(path: Path) -> None:
    table = pyarrow.table({"x": X[:, 0], "z": X[:, 1].astype(np.float32), "n": np.arange(400)})
    pyarrow.parquet.write_table(table, path, row_group_size=128)


def write_sound(path: Path) -> None:
    soundfile.write(path, X, 8000)


def write_uff(path: Path) -> None:
    sets = [
        pyuff.prepare_58(
            binary=0,
            func_type=1,
            rsp_node=node + 1,
            rsp_dir=3,
            ref_dir=0,
            ref_node=0,
            data=X[:, node],
            x=np.arange(400) / 512,
            id1="NONE",
            rsp_ent_name="NONE",
            ref_ent_name="NONE",
            abscissa_spacing=1,
            abscissa_spec_data_type=17,
            abscissa_axis_units_lab="s",
            ordinate_spec_data_type=12,
            ordinate_axis_units_lab="g",
            orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
        )
        for node in (0, 1)
    ]
    pyuff.UFF(str(path)).write_sets(sets, mode="add")


def write_binary_uff(path: Path) -> None:
    """The same sets, the numbers as float64 behind the header (pyuff leaves its file open when it writes these)."""
    ascii_file = path.with_suffix(".ascii")
    write_uff(ascii_file)
    lines = ascii_file.read_bytes().splitlines(keepends=True)
    size = len(lines) // 2
    parts = []
    for node in (0, 1):
        header = lines[node * size : node * size + 13]
        header[1] = b"    58b     1     2          11        3200     0     0           0           0\n"
        parts += [*header, X[:, node].astype("<f8").tobytes(), b"    -1\n"]
    path.write_bytes(b"".join(parts))


SMALL: dict[str, Callable[[Path], None]] = {
    "a.tdms": write_tdms,
    "four.mat": write_mat4,
    "five.mat": write_mat5,
    "packed.mat": lambda path: write_mat5(path, compressed=True),
    "seven.mat": write_mat73,
    "a.h5": write_hdf5,
    "a.parquet": write_parquet,
    "a.wav": write_sound,
    "a.flac": write_sound,
    "a.ogg": write_sound,
    "ascii.uff": write_uff,
    "binary.uff": write_binary_uff,
}
