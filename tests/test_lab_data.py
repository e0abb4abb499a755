"""Records dropped on the lab: every format, every question, and what happens when one goes wrong."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import pyuff
import scipy.io
import soundfile
from nptdms import ChannelObject, TdmsWriter
from starlette.applications import Starlette
from starlette.testclient import TestClient

import stickslip as ss
from robot_logs import write_db3
from stickslip.lab import data
from stickslip.lab.jobs import Limits

FS = 500.0
WAITING = ("waiting", "running")
Client = TestClient


def app_with(**options: Any) -> Starlette:
    """The records' part of the lab alone."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> Any:
        async with data.open_data(**options) as app.state.data:
            yield

    return Starlette(routes=data.routes, lifespan=lifespan)


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with TestClient(app_with()) as client:
        yield client


def send(client: Client, path: Path, name: str | None = None) -> str:
    answer = client.post("/files", params={"name": name or path.name}, content=path.read_bytes())
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def ask(client: Client, question: str, *keys: str, **more: Any) -> str:
    told = {"question": question, "records": more.pop("records", [[key] for key in keys]), **more}
    answer = client.post("/jobs", json=told)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


def ended(client: Client, job: str) -> dict[str, Any]:
    client.get(f"/jobs/{job}/events")  # which end as the job does
    told = client.get(f"/jobs/{job}").json()
    assert told["state"] not in WAITING
    return told


def answered(client: Client, question: str, *keys: str, **more: Any) -> dict[str, Any]:
    result = ended(client, ask(client, question, *keys, **more))
    assert result["state"] == "done", result["message"]
    return result["answer"]


def rubbing() -> ss.Record:
    """A contact that slides back and forth against 1.5 N."""
    time = np.arange(2000) / FS
    v = np.cos(2 * np.pi * time)
    friction = 1.5 * np.sign(v) + np.random.default_rng(1).normal(0, 0.01, time.size)
    return ss.Record.of({"x": np.sin(2 * np.pi * time) / (2 * np.pi), "friction": friction}, fs=FS)


def written(folder: Path, ending: str) -> Path:
    """The rubbing contact, as a file of each format."""
    record, path = rubbing(), folder / f"rubbing{ending}"
    x, friction = record["x"], record["friction"]
    if ending in (".csv", ".h5", ".parquet"):
        return ss.write_record(record, path)
    if ending == ".txt":
        rows = "".join(f"{t:.6g};{a:.9g};{b:.6g}\n" for t, a, b in zip(record.time, x, friction, strict=True))
        path.write_text("time [s];x [m];friction [N]\n" + rows)
    elif ending == ".mat":
        scipy.io.savemat(path, {"t": record.time, "x": x, "friction": friction})
    elif ending == ".tdms":
        told = {"wf_increment": 1 / FS, "wf_samples": len(x)}
        with TdmsWriter(path) as writer:
            writer.write_segment(
                [
                    ChannelObject("rig", name, values, properties={**told, "unit_string": unit})
                    for name, values, unit in (("x", x, "m"), ("friction", friction, "N"))
                ]
            )
    elif ending == ".uff":
        sets = [uff_set(1, "x", x, "m"), uff_set(2, "friction", friction, "N")]
        pyuff.UFF(str(path)).write_sets(sets, mode="add")
    elif ending == ".wav":
        soundfile.write(path, np.column_stack([x, friction / 4]), int(FS), subtype="DOUBLE")
    elif ending == ".lvm":
        rows = "".join(f"{t:.6f}\t{a:.9f}\t{b:.6f}\t\n" for t, a, b in zip(record.time, x, friction, strict=True))
        path.write_text(LVM_HEAD + rows)
    else:
        path.write_text(json.dumps({"time": list(record.time), "x": list(x), "friction": list(friction)}))
    return path


LVM_HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n***End_of_Header***\t\n\nChannels\t2\t\t\n"
    "Samples\t2000\t2000\t\nX_Dimension\tTime\tTime\t\nX0\t0.0\t0.0\t\nDelta_X\t0.002\t0.002\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tx\tfriction\tComment\n"
)


def uff_set(node: int, name: str, values: np.ndarray, unit: str) -> dict[str, Any]:
    return pyuff.prepare_58(
        binary=0,
        func_type=1,
        rsp_node=node,
        rsp_dir=3,
        ref_dir=0,
        ref_node=0,
        data=values,
        x=np.arange(len(values)) / FS,
        id1=name,
        rsp_ent_name=name,
        ref_ent_name="NONE",
        abscissa_spacing=1,
        abscissa_spec_data_type=17,
        abscissa_axis_units_lab="s",
        ordinate_spec_data_type=12,
        ordinate_axis_units_lab=unit,
        orddenom_spec_data_type=0,
        z_axis_spec_data_type=0,
    )


ENDINGS = (".csv", ".txt", ".h5", ".parquet", ".mat", ".tdms", ".uff", ".wav", ".lvm", ".json")


@pytest.fixture(scope="module")
def each_format(client: Client, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, dict[str, Any]]]:
    """A file of each format, with what the lab says of it."""
    paths = [written(tmp_path_factory.mktemp("formats"), ending) for ending in ENDINGS]
    records = answered(client, "describe", *(send(client, path) for path in paths))["records"]
    return dict(zip(ENDINGS, zip(paths, records, strict=True), strict=True))


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_of_each_format_is_described_as_the_library_reads_it(
    each_format: dict[str, tuple[Path, dict[str, Any]]], ending: str
) -> None:
    path, told = each_format[ending]
    record = ss.read_record(path)
    assert told["name"] == path.name
    assert (told["rows"], told["fs"]) == (len(record), record.fs)
    assert [(each["name"], each["unit"]) for each in told["channels"]] == [
        (channel.name, channel.unit) for channel in record.channels.values()
    ]
    for each in told["channels"]:
        assert each["low"] == pytest.approx(record[each["name"]].min(), rel=1e-6)
        assert each["high"] == pytest.approx(record[each["name"]].max(), rel=1e-6)


def test_a_bag_that_is_known_by_its_ending_is_read(client: Client, tmp_path: Path) -> None:
    write_db3(tmp_path / "walk.db3")
    told = answered(client, "describe", send(client, tmp_path / "walk.db3"))["records"][0]
    assert told["rows"] == len(ss.read_record(tmp_path / "walk.db3"))


def test_the_answer_is_the_librarys_to_the_last_printed_digit(client: Client, tmp_path: Path) -> None:
    path = written(tmp_path, ".csv")
    job = ask(client, "analyze", send(client, path))
    with client.stream("GET", f"/jobs/{job}/events") as stream:
        steps = [json.loads(line.removeprefix("data: ")) for line in stream.iter_lines() if line.startswith("data: ")]
    result = ended(client, job)
    findings = ss.analyze(ss.read_record(path))
    words = ss.summary(findings)
    assert result["state"] == "done", result["message"]
    assert result["answer"]["lines"] == [
        [line.name, line.value, line.interval, words.marks(line)] for line in words.lines
    ]
    kept = client.get(f"/jobs/{job}/results.json").json()
    own = json.loads(json.dumps(words.data()["estimates"]))
    # what is rounding alone, as the deviation of a frequency that was given, is another's in another process
    deviations = [np.array([one.pop("sd") for one in rows], float) for rows in (kept["estimates"], own)]
    assert kept["estimates"] == own
    assert np.allclose(*deviations, rtol=1e-9, atol=1e-15, equal_nan=True)
    page = client.get(f"/jobs/{job}/report")
    assert page.headers["content-security-policy"].startswith("sandbox; default-src 'none'")
    assert path.name in page.text
    assert all(line.value in page.text for line in words.lines)
    assert client.get(f"/jobs/{job}/results.zip").content[:2] == b"PK"
    assert steps[-1]["state"] == "done"
    assert {"analysing rubbing.csv", "drawing and writing"} <= {step["words"] for step in steps}
    assert [step["share"] for step in steps] == sorted(step["share"] for step in steps)


def test_only_what_the_library_can_not_infer_is_asked_for(client: Client, tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    path.write_text("disp [mm],F\n" + "".join(f"{np.sin(n / 9):.6f},{n % 7}\n" for n in range(400)))
    key = send(client, path)
    answer = answered(client, "describe", key)
    assert answer["needs"] == ["fs"]
    assert answer["records"][0]["fs"] is None
    assert answer["records"][0]["unknown"] == ["F"]
    reading = {"fs": "0.5 kHz", "channels": {"x": "`disp`", "force": "`F` [N]"}}
    answer = answered(client, "describe", key, reading=reading)
    assert answer["needs"] == []
    assert answer["records"][0]["fs"] == 500
    assert answer["questions"]["analyze"]["needs"] == []
    answer = answered(client, "describe", key, reading={"fs": 500, "channels": {"x": "`disp`"}})
    assert answer["questions"]["analyze"]["needs"] == ["mass", "stiffness"]
    assert not answer["questions"]["decay"]["needs"]
    assert not answered(client, "describe", key, reading={"fs": 500, "channels": {"q": "`disp`"}})["questions"][
        "analyze"
    ]["able"]


def test_a_free_decay_comes_with_its_fitted_motion(client: Client, tmp_path: Path) -> None:
    slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    x = ss.simulate(slider, duration=20.0, start={"x": 1.0}).record(fs=20)["x"]
    record = ss.Record.of({"x": x + np.random.default_rng(1).normal(0, 3e-3, len(x))}, fs=20)
    path = ss.write_record(record, tmp_path / "release.csv")
    answer = answered(client, "decay", send(client, path), options={"method": "waveform", "stiffness": 10})
    findings = ss.analyze_decay(ss.read_record(path), method="waveform", stiffness=10)
    assert answer["lines"][0][1] == ss.summary(findings).lines[0].value
    (curve,) = answer["overlay"]
    assert curve["record"] == "release.csv"
    measured, fitted = (np.array(curve[name], dtype=float) for name in ("measured", "fitted"))
    assert 0 < np.std(measured - fitted) < 6e-3


def test_a_fitted_law_lies_over_the_record(client: Client, tmp_path: Path) -> None:
    slider = ss.Oscillator(
        mass=1.0, stiffness=100.0, law=ss.laws.Coulomb(0.5), drive=ss.drives.HarmonicBase(0.02, frequency=1.0)
    )
    record = ss.simulate(slider, cycles=4).record(fs=100)
    noise = np.random.default_rng(2).normal(0, 1e-5, len(record))
    record = ss.Record.of({"x": record["x"] + noise, "z": record["z"]}, fs=100)
    path = ss.write_record(record, tmp_path / "driven.csv")
    options = {"mass": "1 kg", "stiffness": "0.1 N/mm", "laws": "Coulomb"}
    answer = answered(client, "fit", send(client, path), options=options)
    assert answer["overlay"][0]["channel"] == "x"
    measured, fitted = (np.array(answer["overlay"][0][name]) for name in ("measured", "fitted"))
    assert np.std(measured - fitted) < 2e-5
    assert answer["state"]["law"]["kinetic"] == pytest.approx(0.5, rel=0.01)
    assert ss.systems.read_system(answer["state"]).system.mass == 1.0


def test_several_records_are_compared_and_one_that_does_not_answer_is_named(client: Client, tmp_path: Path) -> None:
    good, other, bad = written(tmp_path, ".csv"), written(tmp_path, ".txt"), tmp_path / "short.csv"
    bad.write_text("time [s],x [m],friction [N]\n0,1,2\n0.1,2,3\n")
    keys = [send(client, good, "light.csv"), send(client, other, "heavy.csv"), send(client, bad, "short.csv")]
    answer = answered(client, "analyze", *keys, options={"normal": ["1 N", "2 N", None]})
    notes = " ".join(answer["notes"])
    assert "Left out: " in notes
    assert "short.csv" in notes


def test_files_of_one_record_are_read_together(client: Client, tmp_path: Path) -> None:
    record, keys = rubbing(), []
    for name in ("x", "friction"):
        part = ss.Record.of({name: record[name]}, fs=FS)
        keys.append(send(client, ss.write_record(part, tmp_path / f"{name}.csv")))
    (told,) = answered(client, "describe", records=[keys])["records"]
    assert told["name"] == "x.csv + friction.csv"
    assert {each["name"] for each in told["channels"]} == {"x", "friction"}


@pytest.mark.parametrize(
    ("name", "contents"),
    [
        ("run.tdms", b"TDSm" + b"\xff" * 300),
        ("run.csv", b"\x00\x01\x02\xff" * 100),
        ("run.mat", b"MATLAB 5.0" + b"?" * 500),
        ("run.json", b"[" * 100_000),
        ("run.h5", b"\x89HDF\r\n\x1a\n" + b"\x00" * 600),
    ],
)
def test_a_bad_file_is_one_sentence_with_its_own_name(client: Client, name: str, contents: bytes) -> None:
    answer = client.post("/files", params={"name": name}, content=contents)
    result = ended(client, ask(client, "describe", answer.json()["id"]))
    assert result["state"] == "refused"
    assert result["message"].count("\n") == 0
    assert name in result["message"]
    assert answer.json()["id"] not in result["message"]


def test_a_file_that_is_too_large_ends_as_it_comes_and_leaves_nothing() -> None:
    sent = []

    def endless() -> Iterator[bytes]:
        for _ in range(64):
            sent.append(1 << 16)
            yield b"x" * (1 << 16)

    with TestClient(app_with(largest=1 << 20)) as client:
        folder = client.app.state.data.uploads.folder
        assert client.get("/files").json() == {"largest": 1 << 20}
        answer = client.post("/files", content=endless())
        assert answer.status_code == 413
        assert "1 MiB" in answer.text
        answer = client.post("/files", content=b"x" * (2 << 20))
        assert answer.status_code == 413
        assert list(folder.iterdir()) == []
        for _ in range(8):
            assert client.post("/files", content=b"x" * (1 << 20)).status_code == 201
    with TestClient(app_with(largest=1 << 20, altogether=3 << 20)) as client:
        codes = [client.post("/files", content=b"x" * (1 << 20)).status_code for _ in range(4)]
        assert codes == [201, 201, 201, 413]
    with TestClient(app_with(largest=1 << 10)) as client:
        assert client.post("/files/example").status_code == 413
        assert list(client.app.state.data.uploads.folder.iterdir()) == []


def test_files_and_answers_are_removed(tmp_path: Path) -> None:
    with TestClient(app_with()) as client:
        held = client.app.state.data
        place = held.uploads.folder.parent
        key = send(client, written(tmp_path, ".csv"))
        assert client.delete(f"/files/{key}").status_code == 204
        assert list(held.uploads.folder.iterdir()) == []
        assert client.delete(f"/files/{key}").status_code == 404
        assert client.post("/jobs", json={"question": "describe", "records": [[key]]}).status_code == 404
        key = send(client, written(tmp_path, ".txt"))
        job = ask(client, "describe", key)
        ended(client, job)
        held.uploads.remove_unused(before=time.monotonic())
        client.portal.call(lambda: held.jobs.remove_ended(before=time.monotonic()))
        assert list(held.uploads.folder.iterdir()) == list(held.jobs.folder.iterdir()) == []
        assert client.get(f"/jobs/{job}").status_code == 404
        send(client, written(tmp_path, ".json"))
        ask(client, "describe", send(client, written(tmp_path, ".mat")))
    assert not place.exists()


def test_an_empty_file_is_refused(client: Client) -> None:
    assert client.post("/files", content=b"").status_code == 400


def test_cancel_ends_the_process_and_what_it_started(client: Client, tmp_path: Path) -> None:
    key = send(client, ss.write_record(ss.datasets.demo(), tmp_path / "demo.csv"))
    job = ask(client, "wavelet", key)
    held = client.app.state.data.jobs.get(job)
    until = time.monotonic() + 600
    while held.process is None and time.monotonic() < until:
        time.sleep(0.01)
    process = held.process.pid
    told = client.delete(f"/jobs/{job}").json()
    assert told["state"] == "cancelled"
    with pytest.raises(ProcessLookupError):
        os.killpg(process, 0)
    assert not held.folder.exists()
    assert client.get(f"/jobs/{job}/report").status_code == 404
    assert client.delete(f"/jobs/{job}").json()["state"] == "cancelled"
    assert answered(client, "describe", key)["records"][0]["rows"] == 24000


WORKERS = {
    "dies": "import os; os.kill(os.getpid(), 11)",
    "raises": "raise RuntimeError('a bug of ours')",
    "shouts": "print('x' * (1 << 20))",
    "lies": "print('[1, 2]')",
    "lingers": "import time; time.sleep(60)",
    "toils": "import resource; resource.setrlimit(resource.RLIMIT_CPU, (1, 2))\nwhile True: pass",
    "links": "import os, sys; os.symlink('/etc/hostname', sys.argv[1] + '/answer.json')",
}
SAID = {
    "dies": "SIGSEGV", "raises": "RuntimeError: a bug of ours", "shouts": "no word of ours", "lies": "no word of ours",
    "lingers": "longer than 2 s", "toils": "1 s of processor time", "links": "fault of the program",
}  # fmt: skip


@pytest.mark.parametrize("fate", WORKERS)
def test_a_worker_that_fails_is_one_message_to_one_user(
    fate: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "failing.py").write_text(WORKERS[fate])
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    wall = 2.0 if fate == "lingers" else 60.0
    with TestClient(app_with(limits=Limits(wall=wall, processor=1.0, at_once=2))) as client:
        key = send(client, written(tmp_path, ".csv"))
        jobs = client.app.state.data.jobs
        jobs.worker = "failing"
        job = ask(client, "describe", key)
        result = ended(client, job)
        assert result["state"] == "broken"
        assert SAID[fate] in result["message"]
        assert "\n" not in result["message"]


@pytest.mark.parametrize(
    "deed",
    [
        "import socket; socket.create_connection(('127.0.0.1', 9))",
        "import os; os.system('true')",
        "import subprocess; subprocess.run(['true'])",
        "import os; os.fork()",
        "import urllib.request; urllib.request.urlopen('http://127.0.0.1:9')",
    ],
)
def test_an_analysis_reaches_no_network_and_starts_no_program(deed: str) -> None:
    begin = "from stickslip.lab.task import limit; limit(memory=1 << 30, processor=5, written=1 << 20)"
    code = f"{begin}\ntry:\n    {deed}\nexcept OSError as error:\n    print(error)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "is not for an analysis" in run.stdout


def test_limits_hold_an_analysis_that_asks_for_too_much(tmp_path: Path) -> None:
    with TestClient(app_with(limits=Limits(memory=300 << 20))) as client:
        path = tmp_path / "large.h5"
        with h5py.File(path, "w") as file:  # a few kB that ask for 8 GB
            file.create_dataset("x", (1_000_000_000,), float, chunks=(1_000_000,), fillvalue=1.0, compression="gzip")
        result = ended(client, ask(client, "analyze", send(client, path), reading={"fs": 1000.0}))
        assert result["state"] in ("refused", "broken")
        assert result["message"]
        assert client.get("/files").status_code == 200


def zip_bomb(size: int) -> bytes:
    """A MATLAB file of a few hundred kB that unpacks to `size` bytes of zeros."""
    head = b"MATLAB 5.0 MAT-file".ljust(116) + b"\0" * 8 + struct.pack("<H2s", 0x0100, b"IM")
    inner = struct.pack("<II", 14, size + 48) + struct.pack("<IIII", 6, 8, 6, 0)  # a matrix of doubles
    inner += struct.pack("<IIii", 5, 8, size // 8, 1)  # of so many rows
    inner += struct.pack("<HH4s", 1, 1, b"x") + struct.pack("<II", 9, size)  # called x, and its numbers
    packing = zlib.compressobj(1)
    packed = packing.compress(inner)
    for _ in range(size >> 20):
        packed += packing.compress(b"\0" * (1 << 20))
    packed += packing.flush()
    return head + struct.pack("<II", 15, len(packed)) + packed


def test_what_unpacks_to_more_than_there_is_ends_as_one_sentence() -> None:
    with TestClient(app_with(limits=Limits(memory=700 << 20))) as client:
        key = client.post("/files", params={"name": "bomb.mat"}, content=zip_bomb(1 << 30)).json()["id"]
        result = ended(client, ask(client, "describe", key, reading={"fs": 100}))
        assert result["state"] == "refused"
        assert "would become" in result["message"]


def test_answers_that_are_kept_are_bounded(tmp_path: Path) -> None:
    with TestClient(app_with(limits=Limits(kept=1))) as client:
        key = send(client, written(tmp_path, ".csv"))
        jobs = [ask(client, "describe", key) for _ in range(2)]
        assert [ended(client, job)["state"] for job in jobs] == ["done", "done"]
        held = client.app.state.data.jobs
        client.portal.call(partial(held.remove_ended, before=0.0))
        assert [client.get(f"/jobs/{job}").status_code for job in jobs].count(404) == 1
        assert len(list(held.folder.iterdir())) == 1


def test_a_curve_is_fitted_to_one_record(tmp_path: Path) -> None:
    with TestClient(app_with()) as client:
        keys = [[send(client, ss.write_record(ss.datasets.demo(), tmp_path / name))] for name in ("a.csv", "b.csv")]
        asked = {"question": "fit", "records": keys, "options": {"curve": "stribeck"}}
        result = ended(client, client.post("/jobs", json=asked).json()["id"])
        assert result["state"] == "refused"
        assert "2 records" in result["message"]


def test_a_record_of_velocity_and_friction_is_fitted_without_mass_and_spring(client: Client, tmp_path: Path) -> None:
    speed = 0.02 * np.sin(2 * np.pi * np.arange(4000) / 1000)
    force = (1.0 + 0.3 * np.exp(-((speed / 4e-3) ** 2))) * np.sign(speed)
    noise = 1e-3 * np.random.default_rng(1).normal(size=speed.size)
    path = ss.write_record(ss.Record.of({"v": speed, "friction": force + noise}, fs=1000), tmp_path / "curve.csv")
    key = send(client, path)
    assert answered(client, "describe", key)["questions"]["fit"]["needs"] == []
    answer = answered(client, "fit", key)
    assert 'the curve "stribeck"' in answer["headline"][0]
    record = ss.read_record(path)
    told = ss.summary(ss.fit_curve(record, curve="stribeck"), record=record).lines[0]
    assert answer["lines"][0][:2] == [told.name, told.value]


def test_what_waits_is_bounded(tmp_path: Path) -> None:
    with TestClient(app_with(limits=Limits(at_once=1, waiting=2))) as client:
        key = send(client, written(tmp_path, ".csv"))
        told = {"question": "wavelet", "records": [[key]]}
        codes = [client.post("/jobs", json=told).status_code for _ in range(6)]
        assert codes[:2] == [202, 202]
        assert codes[-1] == 503


def test_a_long_tdms_file_is_streamed_and_analysed_part_by_part(tmp_path: Path) -> None:
    path, part = tmp_path / "long.tdms", rubbing()
    told = {"wf_increment": 1 / FS, "wf_samples": 2000}
    segment = [
        ChannelObject("rig", name, np.tile(part[name], 500), properties={**told, "unit_string": unit})
        for name, unit in (("x", "m"), ("friction", "N"))
    ]
    with TdmsWriter(path) as writer:
        for _ in range(5):
            writer.write_segment(segment)
    assert path.stat().st_size > 64 << 20
    with TestClient(app_with()) as client:
        key = send_streamed(client, path)
        job = ask(client, "describe", key)
        meanwhile = 0
        while client.get(f"/jobs/{job}").json()["state"] in WAITING:
            client.get("/files")
            meanwhile += 1
            time.sleep(0.02)
        (record,) = client.get(f"/jobs/{job}").json()["answer"]["records"]
        assert record["rows"] == 5_000_000
        assert record["channels"][1]["high"] == pytest.approx(part["friction"].max(), rel=1e-6)
        assert len(record["preview"]["time"]) <= 2 * 2000
        assert meanwhile > 10  # a page that waits for the reading is answered once, at its end


def send_streamed(client: Client, path: Path) -> str:
    def chunks() -> Iterator[bytes]:
        with path.open("rb") as file:
            while chunk := file.read(1 << 20):
                yield chunk

    return client.post("/files", params={"name": path.name}, content=chunks()).json()["id"]


def test_the_example_is_there_to_try(client: Client) -> None:
    told = client.post("/files/example").json()
    (record,) = answered(client, "describe", told["id"])["records"]
    assert record["stated"].keys() == {"mass", "stiffness", "damping"}


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"question": "rm -rf"}, "question"),
        ({"records": []}, "records"),
        ({"records": [["../../etc/passwd"]]}, "records"),
        ({"reading": {"config": "/etc/passwd"}}, "reading.config"),
        ({"options": {"output": "/tmp"}}, "output"),
        ({"options": {"mass": float("1e400")}}, "mass"),
    ],
)
def test_a_question_that_makes_no_sense_is_refused_with_its_field(
    client: Client, change: dict[str, Any], field: str
) -> None:
    told = {"question": "analyze", "records": [["0" * 32]], **change}
    answer = client.post("/jobs", content=json.dumps(told))
    assert answer.status_code == 422
    assert field in answer.text


def test_a_fault_of_the_rig_is_told_in_words_of_the_page(client: Client, tmp_path: Path) -> None:
    key = send(client, written(tmp_path, ".csv"))
    result = ended(client, ask(client, "analyze", key, options={"mass": "-2 kg"}))
    assert result["state"] == "refused"
    assert "mass" in result["message"]


@pytest.mark.parametrize(
    "name",
    ["../../../etc/passwd", "..\\..\\boot.ini", "/etc/shadow", "a\x00b.csv", "\u202egpj.csv", "x" * 5000, "", ".."],
)
def test_a_name_is_a_label_and_never_a_path(client: Client, name: str) -> None:
    folder = client.app.state.data.uploads.folder
    before = set(folder.parent.rglob("*"))
    told = client.post("/files", params={"name": name}, content=b"a,b\n1,2\n").json()
    (made,) = set(folder.parent.rglob("*")) - before
    assert made.parent == folder
    assert made.stem == told["id"]
    assert "/" not in told["name"]
    assert len(told["name"]) <= 120
