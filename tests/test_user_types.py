"""What a user's type-checker says of a script that uses every law: nothing."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import stickslip as ss
from any_law import with_values
from stickslip.scenarios import DRIVES, LAWS

SCRIPT = """
import stickslip as ss
from stickslip.laws.curved import Expression

def popp(speed: Expression) -> Expression:
    return 3.0 / (1 + 1.42 * speed) + 1.0 + 0.1 * speed**2

laws: list[ss.Oscillator] = [
    ss.Oscillator(mass=1.0, stiffness=4.0, law=law)
    for law in (
        ss.laws.Coulomb(1.0, static=1.5), ss.laws.CompliantContact(kinetic=1.0, stiffness=1e5),
        ss.laws.LinearSlope(1.0, slope=-0.1),
        ss.laws.Tabulated([0.0, 0.1], [1.5, 1.0]), ss.laws.StateVariable(kinetic=1.0, rate=100.0),
        ss.laws.InertialContact(kinetic=1.0, stiffness=1e5, mass=0.01), ss.laws.ElastoSlip([1e5, 1e4], [0.5, 0.5]),
        ss.laws.PositionLoad(kinetic=1.0, gradient=0.5), ss.laws.Geared(0.5, back=0.6, load=2.0, driving=0.2),
    )
]
series = ss.laws.InSeries(ss.laws.LinearSlope(1.0, slope=-1.0), stiffness=1e5, damping=9)
chain = ss.Oscillator(mass=1.0, stiffness=4.0, law=series)
stribeck = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.Stribeck(kinetic=1.0, static=1.5, speed=0.1))
curve = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.FrictionCurve(popp))
dahl = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.Dahl(kinetic=1.0, stiffness=1e5))
presliding = ss.laws.LuGre(kinetic=1, static=1.5, speed=0.01, stiffness=1e5, damping=300)
lugre = ss.Oscillator(mass=1, stiffness=4, law=presliding)
rate = ss.Oscillator(
    mass=1.0, stiffness=4.0,
    law=ss.laws.RateState(normal=10, friction=0.6, direct=0.01, evolution=0.015, distance=1e-5, reference=1e-6),
)
late = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.TimeDelay(ss.laws.LinearSlope(1.0, slope=2.0), lag=1e-3))
smooth = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.SmoothStateVariable(kinetic=1, rate=100, steepness=3000))
pad = ss.Contact(ss.laws.Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
squeal = ss.Structure([[1, 0], [0, 1]], [[0, 0], [0, 0]], [[2, 0], [0, 2]], contacts=[pad], drive=ss.drives.Belt(0.8))
drives: list[ss.Oscillator] = [
    laws[1].having(drive=drive)
    for drive in (
        ss.drives.Release(), ss.drives.HarmonicBase(1e-3, frequency=2.5), ss.drives.HarmonicForce(1.0, frequency=2.5),
        ss.drives.MultiTone([(1.0, 2.0, 0.0)]), ss.drives.Belt(0.1), ss.drives.Ramp(0.1),
        ss.drives.Crank(0.05, frequency=2.0, rod=0.2),
        ss.drives.Recorded([0.0, 1.0, 0.0, 1.0], fs=10.0),
        ss.drives.SpeedProfile([0.0, 1.0], [0.0, 0.1]),
        ss.drives.Later(ss.drives.Belt(0.1), 1.0),
        ss.drives.Later(ss.drives.Imposed(ss.drives.Ramp(0.1)), 1.0),
        ss.drives.Dithered(ss.drives.Belt(0.1), amplitude=1e-5, frequency=200.0),
    )
]
run: ss.solve.Trajectory = ss.simulate(lugre, duration=1.0, start={"x": 0.1})
other: ss.solve.Trajectory = ss.simulate(squeal, duration=1.0)
amplitude: float = ss.steady_state(laws[0]).amplitude
value: float = ss.friction_loops(run.record(fs=1000.0)).level.value
"""


def test_a_strict_script_with_every_law_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    api = pytest.importorskip("mypy.api")
    missing = [
        name for name in (*LAWS, *DRIVES, "Structure", "Contact") if not re.search(rf"ss\.(\w+\.)?{name}\(", SCRIPT)
    ]
    assert set(missing) <= set(LAWS)
    more = "".join(
        f"ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.{with_values(LAWS[name])!r})\n" for name in missing
    )
    package = Path(ss.__file__).parent
    assert (package / "py.typed").is_file()
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + more)
    settings = tmp_path / "mypy.ini"  # as where the package is installed: its own code is not reported
    settings.write_text("[mypy]\nstrict = True\n[mypy-stickslip.*]\nfollow_imports = silent\n")
    monkeypatch.setenv("MYPYPATH", str(package.parent))
    cache = Path(__file__).parents[1] / ".mypy_cache" / "scripts"
    told, trouble, code = api.run(
        [str(script), "--config-file", str(settings), "--cache-dir", str(cache), "--python-executable", sys.executable]
    )
    assert (code, trouble) == (0, ""), told
