"""What runs in a worker's process: requests come by its standard input, answers leave by its standard output.

Answered is what the page offers and draws of a system: laws and drives with their parameters, a run from event to
event, its spectrum, wavelet map and sound, and its texts; and what a map asks, part by part: a grid of parameters, or
one cell on finer and finer grids. A sweep asks nobody whether to go on: it is interrupted where no one waits any more.
"""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import json
import math
import os
import re
import signal
import sys
import time
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.lab.task import bound
from stickslip.lab.workers import ANSWER, HEAD, frame

MEMORY = 4 * 2**30  # bytes of data
PATIENCE = 30.0  # s of one run
Answer = tuple[dict[str, Any], dict[str, Any]]
TEX = (
    (r":math:`([^`]*)`", r"\1"), (r"``?", ""), (r"\\mathrm{(\w+)}", r"\1"),
    (r"\\dot\s*\\?(\w+)", r"\1'"), (r"\^{(.*?)}", r"^(\1)"),
    (r"\\le\b", "≤"), (r"\\,", " "), (r"\\varphi", "φ"), (r"\\pi", "π"), (r"\\tau", "τ"), (r"\\?theta", "θ"),
    (r"\\gamma", "γ"), (r"\\sigma", "σ"), (r"\\delta", "δ"), (r"\\alpha", "α"), (r"\\(\w+)", r"\1"),
)  # fmt: skip
FIRST = "THESIS rigid 2.5Hz fk=1.1"
# frequency ratios, none an odd part of one, at which Den Hartog's line is drawn
BOUNDARY = [0.103 + 0.01 * j for j in range(190)]
MORE = ("law", "drive", "contacts")
Array = NDArray[np.float64]
GoOn = Callable[[float], None]

MOST_CYCLES, MOST_CONTACTS, MOST_MASSES = 5000, 4, 12  # played on a page
SHOWN = 200  # cycles drawn, the last ones
A_CYCLE, A_CELL, LEAST, MOST = 60, 3, 2400, 16_000  # instants
A_PIECE, FEW_PIECES, EDGES = 5, 400, 6000
SPECTRUM, OF_SPECTRUM = 4096, 20  # instants and cycles of a spectrum
MAP, COLUMNS, SPAN = 16_384, 400, 60.0  # samples, columns and dB of a wavelet map
HEARD, LASTS, PITCH = 22_050, 3.0, 110.0  # Hz and s of a sound; Hz at which a cycle is heard
EMPTY = 1e-9  # of the largest entry of a matrix: what is smaller is none
MICROSLIP = 0.1  # of the longest slip: a shorter one is a micro-slip
GROUPS = {"x": "displacement", "v": "velocity", "a": "acceleration", "friction": "friction"}
KINDS = ("slip", "microstick", "stick", "flight")


def catalog(request: Mapping[str, Any], go_on: Any) -> Answer:
    """What the form is made of, and what plays first: ``{"laws": ..., "drives": ..., "system": ..., "first": ...}``."""
    return {
        "laws": {name: _part(make) for name, make in ss.scenarios.LAWS.items()},
        "drives": {name: _part(make) for name, make in ss.scenarios.DRIVES.items()},
        "system": _part(ss.Oscillator),
        "contact": _part(ss.Contact),
        "first": {"name": FIRST, "about": ss.systems.scenario_case(FIRST).about, "state": first_state()},
    }, {}


def presets(request: Mapping[str, Any], go_on: Any) -> Answer:
    """The scenarios, those together that are told alike: what is searched, once somebody searches."""
    cases = [ss.systems.scenario_case(name) for name in ss.scenarios.names()]
    alike = itertools.groupby(cases, key=lambda case: (case.about, case.parts))
    return {"presets": [{"about": about, "names": [case.name for case in group]} for (about, _), group in alike]}, {}


def boundary(request: Mapping[str, Any], go_on: Any) -> Answer:
    """Den Hartog's line: the friction ratio at which sliding first stops, over the frequency ratio."""
    ratios = ss.consistent.sliding_boundary(BOUNDARY)
    return {"boundary": list(zip(BOUNDARY, map(float, ratios), strict=True))}, {}


def first_state() -> dict[str, Any]:
    """What plays when the page opens: few cycles, so that one sees their shape."""
    state: dict[str, Any] = json.loads(
        ss.systems.export_system(ss.systems.scenario_case(FIRST).lasting(cycles=8), format="json")
    )
    return state


def _part(make: Any) -> dict[str, Any]:
    """A class by its label, in a line, and parameter by parameter."""
    return {
        "label": getattr(make, "label", ""),
        "about": _plain(inspect.cleandoc(make.__doc__ or "").split("\n\n")[0]),
        "parameters": [_parameter(field) for field in dataclasses.fields(make)],
    }


def _plain(text: str) -> str:
    """A docstring's sentence without its marks."""
    for mark, shown in TEX:
        text = re.sub(mark, shown, text)
    return " ".join(text.split())


def _parameter(field: dataclasses.Field[Any]) -> dict[str, Any]:
    declared = field.metadata["parameter"]
    default = None if field.default is dataclasses.MISSING else field.default
    entry = {
        "name": field.name,
        "label": declared.name,
        "unit": "" if declared.unit == "1" else declared.unit,
        "words": _plain(declared.note),  # what the name and the unit beside it do not say
        "default": default if isinstance(default, int | float | str | None) else None,
        "optional": field.default is not dataclasses.MISSING,
        "choices": list(declared.choices),
        "part": field.name in MORE and not declared.choices,
    }
    empty: dict[str, Any] = {"unit": "", "words": "", "default": None, "optional": False, "choices": [], "part": False}
    return {name: value for name, value in entry.items() if name in ("name", "label") or value != empty[name]}


def read_case(state: Any) -> ss.systems.Case:
    """The system of the page's state, if it is one that a page can play."""
    if not isinstance(state, Mapping):
        raise ss.errors.ModelError("a state that holds no tables", "it has the tables of a system's file", "send those")
    case = ss.systems.read_system(state)
    contacts = len(case.system.contacts) if isinstance(case.system, ss.Structure) else 1
    masses = case.system.size if isinstance(case.system, ss.Structure) else 1
    cycles = case.duration * max(_frequency(case), 1 / case.duration)
    bounds = (("cycles", cycles, MOST_CYCLES), ("contacts", contacts, MOST_CONTACTS), ("masses", masses, MOST_MASSES))
    for name, count, most in bounds:
        if count > most:
            raise ss.errors.ModelError(
                f"{count:g} {name}", f"the page plays up to {most} {name}", "use stickslip simulate"
            )
    return case


def run(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The motion: traces, marks of what holds, and the spectrum."""
    case = read_case(request["state"])
    run = ss.simulate(case.system, start=case.start, progress=go_on, **case.run)  # type: ignore[arg-type]
    cycle = _cycle(run)
    first, last = _window(run, cycle)
    times = _instants(run, first, last, cycle)
    series, values = _series(run, times)
    marks, micro = _marks(run, first, last)
    frequency, amplitude = _spectrum(run, last, cycle)
    header = {
        "status": run.status, "cycle": cycle, "first": first, "last": last, "series": series,
        "springs": _springs(run.system), "belt": run.table.motion.face.get("way", 0.0),
        "spectrum": f"acceleration {run.labels('a')[0]}",
    }  # fmt: skip
    arrays = {"time": times, **values, **marks, "microslips": micro, "frequency": frequency, "amplitude": amplitude}
    return header, arrays


def tell(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """What the library says of the motion, in words and in numbers as it prints them."""
    case = read_case(request["state"])
    outcome = ss.story.outcome(case, progress=go_on)
    answer = {"status": outcome.run.status, "sentences": outcome.sentences, "rows": outcome.rows}
    return {**answer, **_state(case)}, {}  # in SI, whatever units it was asked in


def wavelet(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The wavelet map of the acceleration over the whole run: levels in dB below the largest, as bytes."""
    case = read_case(request["state"])
    run = ss.simulate(case.system, start=case.start, progress=go_on, **case.run)  # type: ignore[arg-type]
    record = run.record(fs=MAP / run.duration)
    wavelets = ss.signals.wavelet_overview(record, run.labels("a")[0], columns=COLUMNS, voices=6)
    level = np.abs(wavelets.values)
    decibel = 20 * np.log10(np.maximum(level / (level.max() or 1.0), 1e-12))
    counts = np.clip(255 * (1 + decibel / SPAN), 0, 255).astype(np.uint8)
    header = {"rows": len(counts), "span": SPAN, "of": f"acceleration {run.labels('a')[0]}"}
    arrays = {"levels": counts.ravel(), "frequency": wavelets.frequency.values, "time": wavelets.time.values}
    return header, arrays


def sound(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """What is heard: the pressure where a surface vibrates across the contact, else friction, quickened to a pitch."""
    case = read_case(request["state"])
    run = ss.simulate(case.system, start=case.start, progress=go_on, **case.run)  # type: ignore[arg-type]
    if isinstance(run.system, ss.Structure) and run.system.size > 1:
        heard = ss.squeak.sound_pressure(run, fs=HEARD)["sound"][-int(LASTS * HEARD) :]
        label = f"sound pressure 10 cm away, in true time, {len(heard) / HEARD:.2g} s of it"
    else:
        quicker = max(1.0, PITCH * _cycle(run))
        lasts = min(LASTS, run.duration / quicker)
        times = np.linspace(run.duration - lasts * quicker, run.duration, max(2, int(lasts * HEARD)))
        heard = run.sample(np.clip(times, 0, run.duration), ("friction",))[0][0]
        label = f"friction, {float(f'{quicker:.3g}'):g} times as fast"
    heard = heard - heard.mean()
    return {"fs": HEARD, "words": label}, {"sound": heard / (np.abs(heard).max() or 1.0)}


def preset(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The state of a scenario."""
    return _state(ss.systems.scenario_case(str(request["name"]))), {}


def export(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The texts that reproduce what is on screen."""
    case = read_case(request["state"])
    return {form: ss.systems.export_system(case, format=form) for form in ("toml", "python")}, {}


def opened(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The state of a system's file."""
    try:
        tables = tomllib.loads(str(request["text"]))
    except (ValueError, RecursionError) as error:  # no TOML, a number of thousands of digits, or nested as deeply
        reason = str(error)[:80]
        raise ss.errors.ModelError(
            f"the text is no TOML ({reason})", "a system is a TOML file", "correct that line"
        ) from error
    return _state(read_case(tables)), {}


ANSWERS: dict[str, Callable[[Mapping[str, Any], GoOn], Answer]] = {
    "catalog": catalog, "boundary": boundary, "run": run, "tell": tell, "wavelet": wavelet, "sound": sound,
    "preset": preset, "presets": presets, "export": export, "open": opened,
}  # fmt: skip


def _state(case: ss.systems.Case) -> dict[str, Any]:
    return {"state": json.loads(ss.systems.export_system(case, format="json"))}


def _frequency(case: ss.systems.Case) -> float:
    period = case.system.drive.motion().period
    return 1 / period if math.isfinite(period) else case.system.frequency


def _cycle(run: ss.solve.Trajectory) -> float:
    """The time after which the motion repeats, or would [s]: the drive's, that of the events themselves, or natural."""
    motion, same = run.table.motion, np.flatnonzero(run.modes == run.modes[-1])
    if math.isfinite(motion.period):
        return min(motion.period, run.duration)
    if len(same) > 1 and motion.rates and motion.knots is None:  # pulled by a belt or a ramp
        return float(run.starts[same[-1]] - run.starts[same[-2]])
    return min(1 / run.system.frequency, run.duration) if run.system.frequency else run.duration


def _window(run: ss.solve.Trajectory, cycle: float) -> tuple[float, float]:
    """First and last instant drawn: of a motion that comes to rest, of all that moved."""
    last = run.duration
    if run.status == "at rest" and len(run.starts) > 1:
        moved = float(run.starts[-1])
        last = min(last, moved + 0.15 * max(moved, cycle))
    return max(0.0, last - SHOWN * cycle), last


def _instants(run: ss.solve.Trajectory, first: float, last: float, cycle: float) -> Array:
    """Even ones, and both sides of every event, so that jumps stay upright."""
    cells = int(np.count_nonzero(run.cells[0] >= first))  # as many as the fastest motion asks for
    count = int(np.clip(max(A_CYCLE * (last - first) / cycle, A_CELL * cells), LEAST, MOST))
    begin, end = np.clip(run.starts, first, last), np.clip(run.starts + run.durations, first, last)
    inside = end > begin
    begin, end = begin[inside], end[inside]
    parts = [np.linspace(first, last, count)]
    if len(begin) <= EDGES:
        parts += [begin, np.maximum(np.nextafter(begin, -np.inf), first)]
    if len(begin) <= FEW_PIECES:
        parts.append((begin[:, None] + np.linspace(0, 1, A_PIECE) * (end - begin)[:, None]).ravel())
    return np.clip(np.unique(np.concatenate(parts)), first, last)


def _series(run: ss.solve.Trajectory, times: Array) -> tuple[list[dict[str, str]], dict[str, Array]]:
    """Each line of the traces with its group and unit, and what moves it; "way" and "slip" are the loops' abscissae."""
    moved = [name for name, part in (("z", "base"), ("force", "force")) if getattr(run.table.motion, part)]
    names = [*GROUPS, *moved, "slip"]
    values, _ = run.sample(times, tuple(names))
    lines = [
        (name, label, unit) for name in names for label, unit in zip(run.labels(name), run.units(name), strict=True)
    ]
    arrays = dict(zip((label for _, label, _ in lines), values, strict=True))
    way = arrays["x"] if "x" in arrays else run.system.tangents[0] @ values[: len(run.labels("x"))]  # type: ignore[union-attr]
    series = {**arrays, "way": way, "slip": arrays["slip" if "slip" in arrays else "slip1"]}
    of = {"z": "x", "slip": "slip"}
    return [{"name": label, "group": of.get(name, name), "unit": unit} for name, label, unit in lines], series


def _marks(run: ss.solve.Trajectory, first: float, last: float) -> tuple[dict[str, Any], Array]:
    """What the contact does from when to when (several: together), and the middles of the micro-slips."""
    number = {kind: j for j, kind in enumerate(KINDS)}
    kinds = np.array([number.get(mode.kind, 0) for mode in run.table.modes])[run.modes]
    ends = run.starts + run.durations
    slips = np.flatnonzero((kinds == 0) & (np.arange(len(kinds)) > 0) & (np.arange(len(kinds)) < len(kinds) - 1))
    lengths = run.durations[slips]
    if isinstance(run.system, ss.Structure) and len(run.system.contacts) > 1:  # a piece ends by any of them
        slips, lengths = slips[:0], lengths[:0]
    short = slips[lengths < MICROSLIP * lengths.max()] if len(slips) else slips
    middles = (run.starts + ends)[short] / 2
    seen = (ends > first) & (run.starts < last) & (run.durations > 0)
    seen &= np.cumsum(seen[::-1])[::-1] <= EDGES
    marks = {"begins": run.starts[seen], "ends": ends[seen], "kinds": kinds[seen].astype(np.int32)}
    return marks, middles[(middles > first) & (middles < last)][-EDGES:]


def _springs(system: ss.Oscillator | ss.Structure) -> list[list[int]]:
    """Between which masses springs are, -1 for what does not move with them: of several by their matrix.

    Contacts that are pressed on are springs across them.
    """
    if not isinstance(system, ss.Structure):
        return [[-1, 0]]
    matrix: Array = np.array(system.stiffness, dtype=float)
    for contact in system.contacts:
        if contact.normal is not None:
            across = np.asarray(contact.normal, dtype=float)
            matrix += contact.stiffness * np.outer(across, across)
    least = EMPTY * np.abs(matrix).max(initial=0.0)
    own = [[-1, j] for j in range(len(matrix)) if abs(matrix[j].sum()) > least]
    return own + [[i, j] for i in range(len(matrix)) for j in range(i + 1, len(matrix)) if abs(matrix[i, j]) > least]


def _spectrum(run: ss.solve.Trajectory, last: float, cycle: float) -> tuple[Array, Array]:
    """Amplitude [m/s^2] of the acceleration over the frequency [Hz], of whole cycles in the later half, by Hann."""
    cycles = max(1, min(OF_SPECTRUM, math.floor(last / cycle / 2 * (1 + 1e-9)))) if run.status != "at rest" else 0
    length = min(cycles * cycle or last, last)
    times = last - length + np.arange(SPECTRUM) * (length / SPECTRUM)
    values = run.sample(np.clip(times, 0, last), ("a",))[0][0]
    weights = np.hanning(SPECTRUM + 1)[:-1]
    amplitude = 2 * np.abs(np.fft.rfft(weights * (values - values.mean()))) / weights.sum()
    frequency = np.arange(1, SPECTRUM // 2 + 1) / length
    return frequency, amplitude[1:]


SETTLE, CYCLES = 60, 12  # periods before and while it is measured
MEASURES = {
    "stops": ("normal_stops", "abnormal_stops"), "micro_slips": ("micro_slips",), "period": ("order",),
    "stick_share": ("stick_share",), "amplitude": ("amplitude",),
}  # fmt: skip
NO_SYSTEM, AT_REST = -1.0, -2.0  # in place of a value
MOST_POINTS = 2000  # points of one part


def sweep(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """One value at each point of a grid of two parameters."""
    system, grid, options = _read(request)
    atlas = ss.sweep(system, grid, measures=[request["measure"]], **options)
    return _values(atlas, request["measure"])


def refine(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The same between two values of each parameter, halved where the answer changes."""
    system, grid, options = _read(request)
    atlas = ss.maps.refine(system, grid, measure=request["measure"], halvings=int(request["halvings"]), **options)
    return _values(atlas, request["measure"])


def warm(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """Load what a first map needs, or compile it: the smallest one of what plays when the page opens."""
    state = first_state()
    run({"state": state}, go_on)
    kinetic = float(state["law"]["kinetic"])
    grid = {"drive.frequency": [2.5, 2.6], "law.kinetic": [kinetic, 1.1 * kinetic]}
    query = {"state": state, "measure": "stops", "grid": grid, "halvings": 1}
    sweep(query, go_on)
    return refine(query, go_on)


MAPS: dict[str, Callable[[Mapping[str, Any], GoOn], Answer]] = {"sweep": sweep, "refine": refine, "warm": warm}


def _read(request: Mapping[str, Any]) -> tuple[Any, dict[str, list[float]], dict[str, Any]]:
    """System, grid and options, if a map can be made of them."""
    case = read_case(request["state"])
    grid = {str(name): [float(value) for value in values] for name, values in request["grid"].items()}
    if request["measure"] not in MEASURES:
        raise ss.errors.ModelError(f"a map of '{request['measure']}'", f"there are {', '.join(MEASURES)}", "choose one")
    size = int(np.prod([len(values) for values in grid.values()]))
    if len(grid) != 2 or not 0 < size <= MOST_POINTS:
        raise ss.errors.ModelError(
            f"{size} points over {len(grid)} parameters", f"a part has two and up to {MOST_POINTS}", "ask less"
        )
    return case.system, grid, {"cycles": CYCLES, "settle": SETTLE, "start": case.start, "engine": "serial"}


def _values(atlas: Any, measure: str) -> Answer:
    """Rows over the second parameter; nan where there is no answer, -1 where no such system, -2 where it rests."""
    values = sum(atlas[name].values.astype(float) for name in MEASURES[measure])
    status, meanings = atlas.status.values, atlas.status.attrs["flag_meanings"].split()
    for word, shown in (("no_such_system", NO_SYSTEM), ("at_rest", AT_REST)):
        values = np.where(status == meanings.index(word) + atlas.status.attrs["flag_values"][0], shown, values)
    return {"shape": list(values.shape)}, {"values": values.ravel()}


class Overtaken(BaseException):
    """No one waits for this answer any more."""


class Patience:
    """What a long run asks some ten times a second: whether to go on."""

    def __init__(self) -> None:
        self.overtaken, self.until = False, math.inf
        self.unasked, self.compiling = False, 0
        signal.signal(signal.SIGINT, self._interrupted)

    def _interrupted(self, *_: object) -> None:
        self.overtaken = True
        if self.unasked and not self.compiling:  # numba is not left in the middle: it ends, or its process is ended
            raise Overtaken

    @contextmanager
    def interrupting(self) -> Iterator[None]:
        """What does not ask whether to go on is interrupted as by Ctrl-C."""
        self.unasked = True
        try:
            self()
            yield
        finally:
            self.unasked = False

    def begin(self) -> None:
        """A new request; its time runs from its first question, when all is compiled."""
        self.overtaken, self.until, self.compiling = False, math.inf, 0

    def __call__(self, share: float = 0.0) -> None:
        """Go on, or raise."""
        if self.overtaken:
            raise Overtaken
        self.until = min(self.until, time.monotonic() + PATIENCE)
        if time.monotonic() > self.until:
            raise ss.errors.SolveError(
                f"the run is {100 * share:.0f} % done after {PATIENCE:g} s",
                "the page waits no longer",
                "ask for fewer cycles, or run it with stickslip simulate",
            )


def answered(request: dict[str, Any], patience: Patience) -> bytes:
    """The answer to a request, whatever it is."""
    reply = {"id": request.get("id"), "want": request.get("want")}
    patience.begin()
    try:
        with patience.interrupting() if request["want"] in MAPS else nullcontext():
            header, arrays = {**ANSWERS, **MAPS}[request["want"]](request, patience)
        return frame({**reply, "kind": request["want"], **header}, arrays)
    except Overtaken:
        return frame({**reply, "kind": "overtaken"})
    except ss.StickslipError as error:
        return frame({**reply, "kind": "error", "error": str(error)})
    except MemoryError:
        return frame(
            {**reply, "kind": "error", "error": "This needs more memory than the page may take; ask for less."}
        )
    except Exception as error:  # noqa: BLE001  # one sentence to one user; the others go on
        sentence = f"The lab can not answer this ({type(error).__name__}: {error}); change what was changed last."
        return frame({**reply, "kind": "error", "error": sentence})


def listen(patience: Patience, say: Callable[[], None]) -> None:
    """Have it said whenever numba begins to compile, which it does not for what it finds on disk."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]  # numba tells no types
        def on_start(self, event: Any) -> None:
            patience.compiling += 1
            say()

        def on_end(self, event: Any) -> None:
            patience.compiling -= 1

    event.register("numba:compile", Listener())


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer one request after the other until there are no more; say of each once that it compiles, where it does."""
    patience = Patience()
    under_way: dict[str, Any] = {}

    def write(answer: bytes, *, last: bool) -> None:
        answers.write(ANSWER.pack(last, len(answer)) + answer)
        answers.flush()

    def compiling() -> None:
        if under_way:
            write(frame({**under_way, "kind": "compiling"}), last=False)
            under_way.clear()

    def answer(request: dict[str, Any]) -> bytes:
        under_way.update(id=request.get("id"), want=request.get("want"))
        try:
            return answered(request, patience)
        finally:
            under_way.clear()

    listening = False
    while len(head := requests.read(HEAD.size)) == HEAD.size:
        request = json.loads(requests.read(HEAD.unpack(head)[0]))
        catalog = request.get("want") == "catalog"  # which needs no kernel, and comes first
        if catalog:
            write(answer(request), last=True)
        if not listening:
            listen(patience, compiling)
            listening = True
        if catalog:  # while the page draws its form, the kernels are loaded
            answer({"want": "run", "state": first_state()})
        else:
            write(answer(request), last=True)


def main() -> None:
    """Serve on this process's own pipes; what else is printed goes to the error stream."""
    bound(RLIMIT_DATA=MEMORY)
    # what overflows is refused in a sentence; the terminal is the user's
    warnings.simplefilter("ignore", RuntimeWarning)
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    main()
