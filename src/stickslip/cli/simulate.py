"""stickslip simulate, sweep, stability, bifurcation, dither, lab: what a system does, asked of its equations."""

from __future__ import annotations

import contextlib
import itertools
import secrets
import signal
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli import option
from stickslip.cli.records import folder_name, number_of, wanted_case
from stickslip.cli.terminal import Output, print_json, progress, publish, say, say_json, say_report, show, wrapped
from stickslip.errors import INTERRUPTED

if TYPE_CHECKING:
    from stickslip.systems import Case

LIST_WIDTH = 100


@click.command()
@click.argument("case", required=False, metavar="[SCENARIO|FILE.toml]")
@click.option("--list", "listed", is_flag=True, help="List the scenarios, with what is known of each.")
@option.case
@click.option("--fs", metavar="HZ", help="Sampling rate of the record; fine enough for the motion unless given.")
@option.form
@click.option("--animate", "animation", type=click.Choice(["gif", "mp4"]), help="Add a moving picture; mp4 by ffmpeg.")
@option.path(
    "--fmu",
    "FILE.fmu",
    "Also write the mass with its friction as a functional mock-up unit (FMI 3), which a C compiler "
    "here compiles; force and z are its inputs.",
)
@click.option("--sound", is_flag=True, help="Add what is heard, sound.wav; of a squeak rig its sensors' record too.")
@option.results("NAME-stickslip")
def simulate(case: str | None, listed: bool, output: Output, fmu: Path | None, **options: Any) -> None:
    """Simulate masses that rub, exactly, event by event.

    What to simulate is a named scenario, or a TOML file of a system: masses, friction laws and a drive. Without
    a name the scenarios are listed.

    Results go into a folder: results.json, the events, the sampled record with friction, and the figures.

    \b
    stickslip simulate FD-4
    stickslip simulate slider.toml --cycles 100 --set "kinetic=1.3 N" --animate gif
    stickslip simulate "SQUEAK wet 6.13 N" --sound
    stickslip simulate law/law.toml --fmu slider.fmu

    Ctrl-C while it runs keeps what was simulated until then, marked "interrupted", with exit code 130.
    """
    if case is None or listed:
        _list_scenarios(as_json=output.as_json, everything=output.everything)
        return
    wanted = wanted_case(case, **{key: options.pop(key) for key in ("duration", "cycles", "changes", "fs")})
    if fmu is not None:
        _write_fmu(wanted, fmu)
    folder = output.folder(folder_name(wanted, "stickslip"))
    if folder:
        ss.story.require_output(wanted, folder=folder, **{key: options[key] for key in ("form", "animation")})
    with progress(1) as tell:
        tell("simulating", 0)
        result = ss.story.outcome(wanted, progress=lambda share: tell(f"simulating, {100 * share:.0f} %", share))
    parts = 4 if options["animation"] else 3
    output.deliver(result, folder, parts=parts, **options)
    if result.run.status == "interrupted":
        raise SystemExit(INTERRUPTED)


def _write_fmu(case: Case, path: Path) -> None:
    system = case.system
    if not isinstance(system, ss.Oscillator):
        raise click.BadParameter("an FMU holds one mass; give an oscillator", param_hint="--fmu")
    values = {name: getattr(system, name) for name in ("mass", "stiffness", "damping", "damper")}
    ss.laws.export_fmu(system.law, path, **values)
    belt = system.drive.speed if isinstance(system.drive, ss.drives.Belt) else 0.0
    # a mass on a belt starts with it where nothing else is said
    begins = {"x": case.start.get("x", 0.0), "v": case.start.get("v", belt), "face_speed": belt}
    states = ", ".join(f"{name} = {value:g}" for name, value in begins.items() if value)
    told = f"; to start as here, set {states} in it" if states else ""
    say(f"{path} holds the mass and its friction, without the drive: force and z are its inputs{told}", err=True)


def _list_scenarios(*, as_json: bool, everything: bool) -> None:
    scenarios = {name: ss.scenarios.get(name) for name in ss.scenarios.names()}
    if as_json:
        say_json({name: scenario.about for name, scenario in scenarios.items()})
        return
    if not everything:
        families = [list(group) for _, group in itertools.groupby(scenarios, key=lambda name: name.partition(" ")[0])]
        shown = [f'"{names[0]}"' + f" and {len(names) - 1} more" * (len(names) > 1) for names in families]
        more = (
            f'{len(scenarios)} scenarios; --all has each with what is known of it; run one: stickslip simulate "NAME"'
        )
        say("\n".join([*wrapped(", ".join(shown)), "", *wrapped(more)]))
        return
    cases = [
        (ss.systems.scenario_case(name), ", ".join(scenario.known).replace("_", " "))
        for name, scenario in scenarios.items()
    ]
    for (about, parts, known), group in itertools.groupby(cases, key=lambda of: (of[0].about, of[0].parts, of[1])):
        say(f"\n{about}\n  {parts}; known: {known}")
        line = ""
        for case, _ in group:
            name = f'  "{case.name}"'
            if len(line) + len(name) > LIST_WIDTH:
                say(line)
                line = ""
            line += name
        say(line)
    say(f'\n{len(scenarios)} scenarios; run one with: stickslip simulate "NAME"')


CASE = click.argument("case", metavar="SCENARIO|FILE.toml")


@click.command()
@click.argument("file", type=option.PATH)
@click.option(
    "--engine",
    default="threads",
    show_default=True,
    metavar="NAME",
    help="Where it runs: serial, threads, dask, dask://HOST:PORT or cuda.",
)
@option.path("--store", "MAP.ZARR", "Where what is done is kept, and goes on after an end; FILE.zarr unless given.")
@option.path("--output", "DIR", "Folder for the report and its figures; none unless given.", callback=option.usable)
@option.json()
@option.everything
def sweep(file: Path, engine: str, store: Path | None, output: Path | None, as_json: bool, everything: bool) -> None:
    """Map what a system does over a grid of its parameters.

    FILE names the system, the grid and what is asked of each motion; every finished block is kept in the store, and a
    sweep that was ended goes on there when it is called again.

    \b
    stickslip sweep grid.toml --engine threads --store map.zarr --output maps
    """
    plan = ss.maps.read_sweep(file)
    place = store if store is not None else file.with_suffix(".zarr")
    atlas = ss.sweep(
        plan.case.system,
        plan.grid,
        measures=plan.measures,
        cycles=plan.cycles,
        settle=plan.settle,
        start=plan.case.start,
        engine=engine,
        store=place,
    )
    story, whole = ss.summary(atlas), atlas.attrs["status"] == "complete"
    written = publish(atlas, output, system=plan.case.system)
    if as_json:
        print_json({**story.data(), "store": str(place)})
        raise SystemExit(0 if whole else INTERRUPTED)
    show(atlas, as_json=False, everything=everything)
    say_report(written, as_json=False)
    say(f"Map: {place}")
    if not whole:
        say("Call again to go on.")
        raise SystemExit(INTERRUPTED)


@click.command()
@CASE
@click.option(
    "--speed", metavar="VALUE", help="Speed of the counter-face in m/s, or with its unit; the belt's unless given."
)
@option.changes
@option.results("NAME-stability")
def stability(case: str, output: Output, speed: str | None, changes: tuple[str, ...]) -> None:
    """Does steady sliding last, or does it squeal, and what feeds the vibration?

    SCENARIO or FILE.toml is what stickslip simulate takes: a mass or a structure on a belt, or at the speed given. Told
    are the modes of small vibrations about steady sliding, and whether mode coupling or a friction that falls with
    speed feeds the one that grows.

    \b
    stickslip stability MC-1
    stickslip stability "SQUEAK wet 6.13 N" --speed "20 mm/s"
    """
    wanted = _case(case, changes)
    fast = None if speed is None else number_of(speed, "m/s", "--speed")
    _answer(wanted, "stability", lambda: ss.stability(wanted.system, speed=fast), output)


@click.command()
@CASE
@click.argument("parameter")
@click.option("--from", "low", required=True, metavar="VALUE", help="Least value, in SI or with its unit.")
@click.option("--to", "high", required=True, metavar="VALUE", help="Largest value.")
@option.count("--steps", 25, "Number of values.", least=2)
@option.count("--transient", 64, "Periods before a motion counts as settled.")
@click.option("--branches", is_flag=True, help="Continue periodic orbits too, the unstable ones between.")
@option.changes
@option.results("NAME-bifurcation")
def bifurcation(case: str, parameter: str, output: Output, **options: Any) -> None:
    """How does the motion change with a PARAMETER, and which motions exist side by side?

    The motion is followed upwards and downwards; where both differ there is hysteresis. Changes of the kind of motion
    (number of stops, period, rest) are found by bisection.

    \b
    stickslip bifurcation slider.toml amplitude --from "0.4 mm" --to "1 mm"
    stickslip bifurcation "DH-3 b=0.5 r=0.8" law.kinetic --from 0.2 --to 0.8 --steps 13
    """
    wanted = _case(case, options["changes"])
    low, high = (wanted.number(parameter, options.pop(key)) for key in ("low", "high"))
    last = options["steps"] - 1
    values = [low + (high - low) * place / last for place in range(last + 1)]
    chosen = {key: options[key] for key in ("transient", "branches")}
    _answer(wanted, "bifurcation", lambda: ss.bifurcation(wanted.system, parameter, values=values, **chosen), output)


@click.command()
@CASE
@option.several("--frequency", "HZ", "Of the dither; a fast one unless given. Repeatable.", to="frequencies")
@option.choice(
    "--on",
    ["face", "base", "force"],
    "What the dither moves: the counter-face, the spring's end, or the mass by a force.",
)
@option.count("--cycles", 40, "Length of a run in periods of the slow motion.")
@click.option(
    "--precision",
    type=click.FloatRange(min=0, max=1, min_open=True),
    default=0.02,
    show_default=True,
    help="Relative width left of the amplitude's range.",
)
@option.changes
@option.results("NAME-dither")
def dither(case: str, output: Output, **options: Any) -> None:
    """Which is the smallest fast vibration along the contact that removes stick-slip?

    Amplitudes are tried by exact simulation, from small to large, until no stick outlasts a period of the dither.

    \b
    stickslip dither slider.toml --frequency 200
    stickslip dither slider.toml --on force
    """
    wanted = _case(case, options["changes"])
    system = wanted.system
    if not isinstance(system, ss.Oscillator):
        raise click.BadParameter("dither is found for a single mass; give an oscillator", param_hint="CASE")
    tones = [number_of(frequency, "Hz", "--frequency") for frequency in options["frequencies"]] or None
    chosen = {key: options[key] for key in ("on", "cycles", "precision")}
    _answer(wanted, "dither", lambda: ss.dither(system, frequency=tones, start=wanted.start or None, **chosen), output)


def _case(name: str, changes: Sequence[str]) -> Case:
    return wanted_case(name, duration=None, cycles=None, changes=changes)


def _answer(case: Case, what: str, ask: Callable[[], Any], output: Output) -> None:
    folder = output.folder(folder_name(case, what))
    with progress(1) as tell:
        tell(f"{what} of {case.name}", 0)
        answer = ask()
    output.deliver(answer, folder)


PORT = 8723


@click.command()
@click.option(
    "--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help="Where it listens; 0: any."
)
@option.path("--config", "RIG.TOML", "The rig whose devices are watched.")
@click.option(
    "--records",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    metavar="DIR",
    help="Where the live view records; the current folder unless given.",
)
@click.option("--no-browser", is_flag=True, help="Print the address alone; open no browser.")
def lab(port: int, config: Path | None, records: Path | None, no_browser: bool) -> None:
    """Open the lab in the browser: play with a contact, map its regimes, ask records, watch a rig as it is measured.

    It runs on this machine alone, for whoever has the address that it prints; nothing leaves the machine. Ctrl-C ends
    it.

    \b
    stickslip lab
    stickslip lab --port 9000 --no-browser
    """
    try:
        from stickslip.lab import server  # its packages are imported where it is wanted
    except ImportError as error:
        raise ss.errors.ModelError(
            f"the lab needs the package {error.name}",
            "it comes with the extra [lab]",
            'pip install ".[lab]" in the checkout',
        ) from error

    with server.listening(port) as door:
        token = secrets.token_urlsafe(24)
        address = f"http://127.0.0.1:{door.getsockname()[1]}/?token={token}"

        def opened(doorway: Callable[[str], Path]) -> None:
            say(f"The lab is open at {address}\nCtrl-C ends it.")
            if not no_browser:
                webbrowser.open(doorway(address).as_uri())

        with contextlib.suppress(KeyboardInterrupt):  # one before the server listens, or behind its end
            server.serve(door, token=token, opened=opened, rig=config, records=records)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # one more has nothing left to end
        say("The lab has ended.")
