"""Drivers against stand-ins of their vendors' packages, and a serial port against a pseudo terminal."""

from __future__ import annotations

import os
import sys
import threading
import types
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import stickslip as ss
from stickslip.bench import Tone, Wanted, acquire, blocks, devices, find_device, in_si


def module(monkeypatch: pytest.MonkeyPatch, name: str, **members: Any) -> types.ModuleType:
    made = types.ModuleType(name)
    vars(made).update(members)
    made.__spec__ = types.SimpleNamespace(name=name)  # type: ignore[assignment]  # what find_spec asks for
    monkeypatch.setitem(sys.modules, name, made)
    return made


# ---- serial: a real port, but for the wire


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals here")
def test_lines_of_a_serial_port(tmp_path: Path) -> None:
    pytest.importorskip("serial")
    board, port = os.openpty()
    table = {"kind": "serial", "port": os.ttyname(port), "fs": 100, "counter": 1, "wrap": 256,
             "channels": {"x": "#2 [mm]", "load": "#3 [V] @ 500 mV/N"}}  # fmt: skip
    device = find_device("board", {"board": table})
    with device.open() as stream:
        lines = [f"{(250 + k) % 256};{k / 10};{k / 2}" for k in range(20)]
        lines[7] = "garb\xffage"
        del lines[12:15]
        os.write(board, ("5;1.0;2" + "\r\n" + "\r\n".join(lines) + "\r\n").encode("latin-1"))
        got = [block for _ in range(6) if (block := stream.read(0.2)).samples.shape[1]]  # type: ignore[union-attr]
    os.close(board)
    os.close(port)
    assert [(block.first, block.after) for block in got] == [(0, 7), (8, 12), (15, 20)]
    values = np.concatenate([in_si(device, block) for block in got], axis=1)
    there = np.array([*range(7), *range(8, 12), *range(15, 20)])
    np.testing.assert_allclose(values[0], there * 1e-4)
    np.testing.assert_allclose(values[1], there / 2 / 0.5)


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals here")
def test_lines_that_come_one_by_one_are_handed_on_together() -> None:
    """Of a board that sends 500 a second the live view drew 500 frames a second, of which each told of one sample."""
    pytest.importorskip("serial")
    board, port = os.openpty()
    table = {"kind": "serial", "port": os.ttyname(port), "fs": 500, "channels": {"x": "#1 [mm]"}}

    def sends() -> None:
        for k in range(11):  # the first one began before we listened
            os.write(board, b"%d\n" % k)
            threading.Event().wait(0.002)

    with find_device("board", {"board": table}).open() as stream:
        thread = threading.Thread(target=sends)
        thread.start()
        block = stream.read(60.0)
        thread.join()
    assert block is not None
    assert (block.first, block.after) == (0, 10)
    os.close(board)
    os.close(port)


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals here")
def test_lines_with_too_few_columns_are_told(tmp_path: Path) -> None:
    pytest.importorskip("serial")
    board, port = os.openpty()
    table = {"kind": "serial", "port": os.ttyname(port), "fs": 20, "channels": {"x": "#1 [mm]", "load": "#3 [N]"}}
    with find_device("board", {"board": table}).open() as stream:
        os.write(board, b"".join(b"%d;7.5\r\n" % k for k in range(60)))
        with pytest.raises(ss.errors.RecordError, match=r"59 lines.*'59;7.5'.*3 numbers") as refused:
            stream.read(2.0)
    assert "baud = 115200" in refused.value.next_step
    os.close(board)
    os.close(port)


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals here")
@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (b"Booting\r\nsensor found\r\n" * 8 + b"3\r\n4\r\n", ""),  # a board that greets
        (b"1.0\r" * 100, "no end of a line after '1.0"),
        (b"\x8e\xf1\n" * 3, "2 lines of which none could be read, the last one"),
        (bytes(range(128, 256)) * 60, "lines of which none could be read"),  # longer than any line
    ],
)
def test_what_is_no_line_of_numbers_is_told_before_it_passes_for_silence(
    sent: bytes, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("serial")
    tty = pytest.importorskip("tty")
    monkeypatch.setattr("stickslip.bench.serial.PATIENCE", 0.3)
    board, port = os.openpty()
    tty.setraw(port)
    table = {"kind": "serial", "port": os.ttyname(port), "fs": 200, "channels": {"x": "#1 [mm]"}}
    with find_device("board", {"board": table}).open() as stream:
        threading.Thread(target=os.write, args=(board, sent)).start()
        if said:
            with pytest.raises(ss.errors.RecordError, match=said):
                stream.read(3.0)
        else:
            block = stream.read(3.0)
            assert block is not None
            np.testing.assert_array_equal(block.samples, [[3.0, 4.0]])
    os.close(board)
    os.close(port)


def test_a_port_that_is_not_there() -> None:
    pytest.importorskip("serial")
    table = {"kind": "serial", "port": "/dev/no-such-port", "fs": 100, "channels": {"x": "#1 [mm]"}}
    device = find_device("board", {"board": table})
    with pytest.raises(ss.errors.ModelError, match="can not be opened"):
        device.open()


# ---- sound


class Card:
    """sounddevice.InputStream as far as it is used."""

    last: ClassVar[Card]

    def __init__(self, *, device: Any, channels: int, samplerate: float, dtype: str, callback: Any) -> None:
        if samplerate > 96_000:
            raise ValueError("Invalid sample rate")
        assert dtype == "int16"
        self.channels, self.callback, self.started, self.closed = channels, callback, False, False
        Card.last = self

    def start(self) -> None:
        self.started = True

    def close(self) -> None:
        self.closed = True

    def bring(self, first: int, count: int, *, lost: bool = False) -> None:
        data = np.array([[first + k + 1000 * c for c in range(self.channels)] for k in range(count)], dtype=np.int16)
        times = types.SimpleNamespace(inputBufferAdcTime=50.0 + first / 8000)
        self.callback(data, count, times, types.SimpleNamespace(input_overflow=lost))


def test_a_sound_card(monkeypatch: pytest.MonkeyPatch) -> None:
    card = {"name": "USB microphone", "max_input_channels": 2}
    module(monkeypatch, "sounddevice", InputStream=Card, PortAudioError=RuntimeError, query_devices=lambda: [card])
    assert next(device.there for device in devices() if device.kind == "sound") == ("USB microphone (2 inputs)",)
    table = {"kind": "sound", "fs": 8000, "channels": {"sound": {"at": "#2 [1] @ 0.1 1/Pa", "serial": "M1"}}}
    device = find_device("ear", {"ear": table})
    with device.open() as stream:
        assert Card.last.started
        assert stream.read(0.0).samples.shape == (1, 0)  # type: ignore[union-attr]
        Card.last.bring(0, 100)
        Card.last.bring(160, 100, lost=True)
        got = [stream.read(1.0) for _ in range(2)]
    assert Card.last.closed
    assert [block.first for block in got if block] == [0, 160]
    values = in_si(device, got[1])  # type: ignore[arg-type]
    np.testing.assert_allclose(values[0], (np.arange(160, 260) + 1000) / 32768 / 0.1)
    assert (device.inputs[0].unit, device.inputs[0].serial) == ("Pa", "M1")
    with pytest.raises(ss.errors.ModelError, match="takes this rate"):
        find_device("ear", {"ear": {"kind": "sound", "fs": "1 MHz"}}).open()


# ---- National Instruments


class DaqError(Exception):
    error_code = -200284


class NiTask:
    """nidaqmx.Task as far as it is used: inputs that count in millivolts, outputs that are kept."""

    made: ClassVar[list[NiTask]] = []

    def __init__(self) -> None:
        self.channels: list[tuple[str, float, float]] = []
        self.written: Any = None
        self.closed, self.sent = False, 0
        self.ai_channels = self.ao_channels = self.timing = self.in_stream = self
        self.avail_samp_per_chan = 0
        NiTask.made.append(self)

    def add_ai_voltage_chan(self, name: str, *, min_val: float, max_val: float) -> None:
        if "ai9" in name:
            raise DaqError("Physical channel specified does not exist on this device.\nDevice: Dev1")
        self.channels.append((name, min_val, max_val))

    def add_ao_voltage_chan(self, name: str) -> None:
        self.channels.append((name, 0.0, 0.0))

    def cfg_samp_clk_timing(self, fs: float, *, sample_mode: str, samps_per_chan: int) -> None:
        self.fs, self.mode, self.length = fs, sample_mode, samps_per_chan

    def start(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True

    def write(self, volts: Any, *, auto_start: bool) -> None:
        self.written = volts


class Reader:
    def __init__(self, stream: NiTask) -> None:
        self.task = stream

    def read_many_sample(self, out: Any, *, number_of_samples_per_channel: int, timeout: float) -> None:
        at = np.arange(self.task.sent, self.task.sent + number_of_samples_per_channel)
        if at[-1] >= 1000:
            raise DaqError("Some or all of the samples requested have not yet been acquired.")
        out[:] = [at * 1e-3 + channel for channel in range(len(out))]
        self.task.sent = int(at[-1]) + 1


@pytest.fixture
def ni(monkeypatch: pytest.MonkeyPatch) -> None:
    NiTask.made.clear()
    unit = types.SimpleNamespace(name="Dev1", product_type="USB-6211", serial_num=0xBEEF)
    system = types.SimpleNamespace(
        Device=lambda name: unit, System=types.SimpleNamespace(local=lambda: types.SimpleNamespace(devices=[unit]))
    )
    errors = types.SimpleNamespace(DaqError=DaqError, DaqReadError=DaqError)
    module(monkeypatch, "nidaqmx", Task=NiTask, system=system, errors=errors)
    kinds = types.SimpleNamespace(CONTINUOUS="continuous", FINITE="finite")
    module(monkeypatch, "nidaqmx.constants", AcquisitionType=kinds)
    module(monkeypatch, "nidaqmx.stream_readers", AnalogMultiChannelReader=Reader)


def test_a_unit_without_its_driver_is_one_sentence(ni: None, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> None:
        raise RuntimeError("Could not find an installation of NI-DAQmx.\nAsk for it.")

    monkeypatch.setattr(sys.modules["nidaqmx"], "Task", absent)
    unit = find_device(
        "daq", {"daq": {"kind": "ni", "device": "Dev1", "fs": 500, "channels": {"x": "ai0 [V] @ 1 V/m"}}}
    )
    with pytest.raises(ss.errors.ModelError, match=r"installation of NI-DAQmx\.\); it needs NI-DAQmx; install"):
        unit.open()


def test_a_unit_of_national_instruments(ni: None) -> None:
    table = {
        "kind": "ni", "device": "Dev1", "fs": 1000,
        "channels": {"load": {"at": "ai0 [V] @ 500 mV/N", "range": "5 V"}, "a": "ai3 [V] @ 100 mV/g"},
        "outputs": {"base": {"at": "ao0", "sensitivity": "2 mm/V", "stroke": "4 mm"}},
    }  # fmt: skip
    device = find_device("daq", {"daq": table})
    assert device.model == "USB-6211, serial BEEF"
    assert next(device.there for device in devices() if device.kind == "ni") == ("Dev1: USB-6211",)
    with device.open() as stream:
        got = in_si(device, next(blocks(stream, count=20)))
        stream.drive("base", Tone(1e-3, 30.0, 0.5))
        measuring, moving = NiTask.made
        turns = round(30.0 * moving.length / 1000)
        assert abs(turns * 1000 / 30.0 - moving.length) < 1e-9 * moving.length
        t = np.arange(moving.length) / 1000
        np.testing.assert_allclose(moving.written, 0.5 * np.cos(2 * np.pi * 30 * t + 0.5), atol=1e-9)
        stream.drive("base", None)
        assert moving.closed
        assert not NiTask.made[-1].written.any()
        measuring.sent = 995
        empty = stream.read(0.1)
        assert empty is not None
        assert empty.samples.shape == (2, 0)
        with pytest.raises(ss.errors.ModelError, match="stroke"):
            stream.drive("base", Tone(5e-3, 1.0))
    assert all(task.closed for task in NiTask.made)
    assert measuring.channels == [("Dev1/ai0", -5.0, 5.0), ("Dev1/ai3", -10.0, 10.0)]
    np.testing.assert_allclose(got[0], np.arange(20) * 2e-3)
    np.testing.assert_allclose(got[1], (np.arange(20) * 1e-3 + 1) * 98.0665)
    assert device.inputs[0].limit == 10.0
    table["channels"] = {"x": "ai9 [V] @ 1 V/mm"}
    with pytest.raises(ss.errors.ModelError, match="does not exist on this device"):
        find_device("daq", {"daq": table}).open()


# ---- LDAQ


class BaseAcquisition:
    pass


class Simulated(BaseAcquisition):
    def __init__(self, name: str = "") -> None:
        self.sample_rate, self.name, self.sent, self.closed = 500, name, 0, False

    def set_data_source(self) -> None:
        self._channel_names_init = ["ch1", "ch2"]

    def read_data(self) -> np.ndarray:
        first, self.sent = self.sent, self.sent + 25
        return np.column_stack([np.arange(first, self.sent), -np.arange(first, self.sent)]).astype(float)

    def terminate_data_source(self) -> None:
        self.closed = True


def test_a_source_of_ldaq(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    module(monkeypatch, "LDAQ")
    module(monkeypatch, "LDAQ.acquisition_base", BaseAcquisition=BaseAcquisition)
    module(monkeypatch, "LDAQ.simulator", Simulated=Simulated, secret=print)
    table = {"acquisition": "simulator.Simulated", "arguments": {"name": "a"}, "channels": {"x": "ch2 [V] @ 1 V/mm"}}
    device = find_device("ldaq", {"ldaq": table})
    done = acquire(device, output=tmp_path / "run.h5", wanted=Wanted(seconds=0.2))
    np.testing.assert_allclose(ss.read_record(done.paths[0])["x"], -np.arange(100) * 1e-3)
    assert device.acquisition.closed  # type: ignore[attr-defined]
    for wrong in ("simulator.secret", "os.system", "simulator.None", "..simulator.Simulated"):
        with pytest.raises(ss.errors.ModelError):
            find_device("ldaq", {"ldaq": {**table, "acquisition": wrong}})


# ---- a record


def test_a_record_is_played(tmp_path: Path) -> None:
    record = ss.datasets.demo().rows(0, 1000)
    path = ss.write_record(record, tmp_path / "run.csv")
    device = find_device("old", {"old": {"kind": "file", "path": "run.csv", "fast": True}}, folder=tmp_path)
    done = acquire(device, output=tmp_path / "again.h5")
    again = ss.read_record(done.paths[0])
    assert done.ended == "the device ended"
    for name in record:
        np.testing.assert_array_equal(again[name], record[name])
        assert again.channels[name].delay == record.channels[name].delay
    slow = find_device("old", {"old": {"kind": "file", "path": path.name}}, folder=tmp_path)
    with slow.open() as stream:
        stream.began -= 0.1  # type: ignore[attr-defined]  # as if it had played for so long
        first = stream.read()
        assert first is not None
        assert first.samples.shape[1] == round(0.02 * record.fs)


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "LDAQ", None)
    first = next(device for device in devices() if device.kind == "ldaq")
    assert first.missing.startswith("LDAQ: pip install")
    with pytest.raises(ss.errors.ModelError, match="pip install"):
        find_device("ldaq", {"ldaq": {"acquisition": "a.B", "channels": {"x": "c [mm]"}}})
