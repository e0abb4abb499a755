"""stickslip simulate"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.options import case_options, folder_name, form_option, result_options, wanted_case
from stickslip.cli.progress import progress
from stickslip.cli.show import show
from stickslip.cli.terminal import say, say_json, wrapped
from stickslip.errors import INTERRUPTED

LIST_WIDTH = 100


@click.command()
@click.argument("case", required=False, metavar="[SCENARIO|FILE.toml]")
@click.option("--list", "listed", is_flag=True, help="List the scenarios, with what is known of each.")
@case_options
@click.option("--fs", metavar="HZ", help="Sampling rate of the record; fine enough for the motion unless given.")
@form_option
@click.option("--animate", "animation", type=click.Choice(["gif", "mp4"]), help="Add a moving picture; mp4 by ffmpeg.")
@click.option("--sound", is_flag=True, help="Add what is heard, sound.wav; of a squeak rig its sensors' record too.")
@result_options("NAME-stickslip")
def simulate(
    case: str | None, listed: bool, output: Path | None, as_json: bool, everything: bool, **options: Any
) -> None:
    """Simulate masses that rub, exactly, event by event.

    What to simulate is a named scenario, or a TOML file of a system: masses, friction laws and a drive. Without
    a name the scenarios are listed.

    Results go into a folder: results.json, the events, the sampled record with friction, and the figures.

    \b
    stickslip simulate FD-4
    stickslip simulate slider.toml --cycles 100 --set "kinetic=1.3 N" --animate gif
    stickslip simulate "SQUEAK wet 6.13 N" --sound

    Ctrl-C while it runs keeps what was simulated until then, marked "interrupted", with exit code 130.
    """
    if case is None or listed:
        _list_scenarios(as_json=as_json, everything=everything)
        return
    wanted = wanted_case(case, **{key: options.pop(key) for key in ("duration", "cycles", "changes", "fs")})
    folder = output or (None if as_json else folder_name(wanted, "stickslip"))
    if folder:
        ss.story.require_output(wanted, folder=folder, **{key: options[key] for key in ("form", "animation")})
    with progress(4 if options["animation"] else 3) as tell:
        tell("simulating", 0)
        result = ss.story.outcome(wanted, progress=lambda share: tell(f"simulating, {share:.0%}", share))
        written = ss.publish(result, folder=folder, tell=tell, **options) if folder else None
    show(result, written, as_json=as_json, everything=everything, **options)
    if result.run.status == "interrupted":
        raise SystemExit(INTERRUPTED)


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
