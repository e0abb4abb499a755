"""stickslip rig and thesis: records of a simulated rig, and the thesis reproduced"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli import option
from stickslip.cli.records import folder_after, folder_name, groups_of, pair, rig_of, wanted_case
from stickslip.cli.terminal import Output, aligned, progress, say, say_json, wrapped

if TYPE_CHECKING:
    from stickslip import Record, Rig
    from stickslip.answers import ExperimentPlan
    from stickslip.solve import Trajectory

FS, RATES = (4000.0,), (1000.0, 2000.0, 4000.0)  # Hz
PRESETS = {"air-track": "air_track", "linear-bearing": "linear_bearing", "perfect": "perfect"}
_ROW = ("place", "quantity", "verdict", "why")


class _Rig(click.Group):
    """What is no other command of the group measures: `stickslip rig SCENARIO`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """With the command's name where it is left out."""
        return super().parse_args(ctx, args if args and args[0] in self.commands else ["measure", *args])


@click.group(cls=_Rig)
def rig() -> None:
    """Measure a simulated motion with a virtual rig, plan an experiment on it, or join what two recorders wrote."""


@rig.command("measure")
@click.argument("case", metavar="SCENARIO|FILE.toml")
@option.choice("--preset", list(PRESETS), "The sensors: one of the thesis's two rigs, or sensors without a fault.")
@option.several(
    "--sensor",
    '"CHANNEL.NAME=VALUE"',
    'Another value of a sensor, in SI: "x.lag=0", "load.limit=20", "a.frequency=2000". Repeatable.',
    to="sensors",
)
@option.several(
    "--fs",
    "HZ",
    "Sampling rate, 4000 unless given; of a plan 1000, 2000 and 4000. Repeatable in a plan.",
    to="rates",
    type=option.POSITIVE,
)
@click.option(
    "--start", type=float, metavar="S", default=0.0, show_default=True, help="Time of the motion when recording begins."
)
@option.count("--seed", 1, "The same seed, the same noise.", least=0)
@click.option("--stated", is_flag=True, help="State in the record what a calibration of the sensors would say.")
@click.option("--plan", is_flag=True, help="Do not keep a record: tell how accurate which sensors and rates would be.")
@option.count("--draws", 5, "Records of each rate in a plan.")
@option.several(
    "--need",
    '"QUESTION=ERROR"',
    'Of a plan, the least that is enough: "contact stiffness=500 N/m", "friction=10 mN". Repeatable.',
)
@option.path("--config", "RIG.TOML", "Of a plan: its [shaker] has to be able to move the base so.")
@option.form
@option.case
@option.results("NAME-rig, or NAME-plan,")
def measure(case: str, output: Output, plan: bool, **options: Any) -> None:
    """Measure a simulated motion with a virtual rig, or plan an experiment on it.

    SCENARIO or FILE.toml is what stickslip simulate takes. The record is what sensors would have written that lag,
    ring, forget, clip and round, with the truth beside it: try a method on it before there is a rig.

    What two recorders with clocks of their own wrote of one run is made one record by stickslip rig join.

    With --plan the motion is measured again and again, at each --fs, with and without the accelerometer and the load
    cell, and a table tells how far off the answers are: the delay between sensors, the friction at each moment and its
    level, the contact's stiffness.

    \b
    stickslip rig slider.toml --fs 4000 --start 2 --output run1
    stickslip rig slider.toml --plan --fs 500 --fs 1000 --fs 4000 --start 2 --need "friction=10 mN"
    """
    wanted = wanted_case(case, **{key: options.pop(key) for key in ("duration", "cycles", "changes")})
    bench = _bench(options.pop("preset"), options.pop("sensors"))
    folder = output.folder(folder_name(wanted, "plan" if plan else "rig"))
    needs = [pair(need, "--need") for need in options.pop("need")]
    if needs and not plan:
        raise click.BadParameter("what is needed is asked of a plan; add --plan", param_hint="--need")
    form, config = options.pop("form"), options.pop("config")
    settings = ss.rig.read_rig(config) if config else None
    options["shaker"] = ss.rig.Shaker.of(settings.shaker) if settings and settings.shaker else None
    with progress(1) as tell:
        tell("simulating", 0)
        run = ss.story.outcome(wanted, progress=lambda share: tell(f"simulating, {100 * share:.0f} %", 0)).run
        results = _planned(run, bench, tell, options) if plan else _measured(run, bench, tell, options)
    context = {"needs": needs} if plan else {"form": form}
    output.deliver(results, folder, **context)


def _bench(preset: str, changes: tuple[str, ...]) -> Rig:
    """The rig of that name, with what the command line changes of its sensors."""
    chosen: Rig = getattr(ss.Rig, PRESETS[preset])()
    for change in changes:
        name, text = pair(change, "--sensor")
        channel, point, detail = name.partition(".")
        try:
            value = float(text)
        except ValueError:
            point = ""
        if not point:
            raise click.BadParameter(f"'{change}' is not CHANNEL.NAME=NUMBER", param_hint="--sensor")
        chosen = chosen.having(channel, **{detail: value})
    return chosen


def _measured(run: Trajectory, bench: Rig, tell: Callable[[str, float], None], options: Mapping[str, Any]) -> Record:
    """One record."""
    if len(options["rates"]) > 1:
        raise click.BadParameter("a record has one sampling rate; several go with --plan", param_hint="--fs")
    tell("measuring", 0.5)
    record = bench.measure(run, fs=(options["rates"] or FS)[0], rng=options["seed"], start=options["start"])
    return bench.stated(record) if options["stated"] else record


def _planned(
    run: Trajectory, bench: Rig, tell: Callable[[str, float], None], options: Mapping[str, Any]
) -> ExperimentPlan:
    """Many."""
    chosen = {name: options[name] for name in ("draws", "seed", "start", "shaker")}
    return ss.answers.plan_experiment(run, rig=bench, rates=options["rates"] or RATES, progress=tell, **chosen)


@rig.command("join")
@click.argument("first")
@click.argument("second")
@option.several("--first-channels", '"NAME=COLUMN [UNIT]"', "Columns of FIRST. Repeatable.")
@option.several("--second-channels", '"NAME=COLUMN [UNIT]"', "Columns of SECOND. Repeatable.")
@click.option(
    "--on", metavar='"CHANNEL" or "CHANNEL,CHANNEL"', help="What both recorded of one motion; found unless given."
)
@click.option(
    "--offset", metavar="TIME", help="Time to add to SECOND's clock in s, or with its unit; found unless given."
)
@click.option("--drift", is_flag=True, help="Find how much faster one clock runs, too.")
@option.form
@option.results("FIRST-joined")
@option.reading
def join(first: str, second: str, output: Output, **options: Any) -> None:
    """Make one record of what two recorders wrote of the same run, each on its own clock.

    FIRST keeps its clock; SECOND is moved by the offset at which both saw the same motion, and interpolated onto FIRST.
    A displacement may meet a velocity or an acceleration. The folder holds the joined record, which the other commands
    read without options.

    \b
    stickslip rig join daq.csv logger.csv --first-channels "x=pos [mm]" --second-channels "v=speed [m/s]"
    """
    form, on, shift, drift = (options.pop(key) for key in ("form", "on", "offset", "drift"))
    own = [options.pop(f"{which}_channels") for which in ("first", "second")]
    if options["channels"] and any(own):
        raise click.BadParameter("columns are named for both, or for each", param_hint="--channels")
    groups = groups_of(first, second)
    if len(groups) != 2:
        raise click.BadParameter(f"{len(groups)} records; two are joined", param_hint="FIRST SECOND")
    seconds = None if shift is None else float(ss.Estimate.stated("offset", shift, "s"))
    shared = None if on is None else tuple(channel.strip() for channel in on.split(","))
    with progress(2) as tell:
        tell("reading", 0)
        a, b = (
            ss.answers.read_mended(group, rig=rig_of(**{**options, "channels": named or options["channels"]}))
            for group, named in zip(groups, own, strict=True)
        )
        tell("finding the offset of the clocks", 1)
        named_on: Any = shared[0] if shared and len(shared) == 1 else shared
        rate = ss.signals.clock_rate(a, b, on=named_on) if drift else 1.0
        joined = ss.signals.synchronise(a, b, on=named_on, offset=seconds, rate=rate)
    output.deliver(joined, output.folder(folder_after(groups[0][0], "joined")), form=form)


@click.command()
@click.argument("chapters", nargs=-1, metavar="[CHAPTER]...")
@option.results("thesis-stickslip")
def thesis(chapters: tuple[str, ...], output: Output) -> None:
    """Reproduce the thesis: every printed number beside ours with a verdict, every figure beside its caption.

    All chapters, or those named: numbers and figures are computed from the printed parameters, and one page is
    written with results.json and the figures. Each number has one of seven verdicts (same, put in,
    corrected, ambiguous, contradicts itself, not printed, ours differs), with why.

    \b
    stickslip thesis
    stickslip thesis 6 --output chapter6

    Beside each figure stands what the text says that one should see, ticked where a number of ours shows it. The exit
    code is 1 where a verdict no longer holds, or something is no longer seen.
    """
    import stickslip_thesis.page as pages  # the chapters compute and draw: they take a second to load

    wanted = chapters or tuple(pages.CHAPTERS)
    if strangers := [name for name in wanted if name not in pages.CHAPTERS]:
        raise click.BadParameter(f"'{strangers[0]}' is none of {', '.join(pages.CHAPTERS)}", param_hint="CHAPTER")
    folder = output.folder(Path("thesis-stickslip"))
    with progress(len(wanted) + 1) as tell:
        done = pages.reproduce(wanted, folder=folder, tell=tell)
    results = pages.results(done)
    if output.as_json:
        say_json(results)
    else:
        _show(results, done, folder, everything=output.everything)
    if not pages.holds(results):
        raise SystemExit(1)


def _show(results: dict[str, Any], done: tuple[Any, ...], folder: Path | None, *, everything: bool) -> None:
    verdicts = {verdict: count for verdict, count in results["verdicts"].items() if count}
    say("\n".join(wrapped(f"{sum(verdicts.values())} printed numbers: {_counted(verdicts)}.")))
    unseen = [entry for entry in results["seen"] if not entry["seen"]]
    if results["seen"]:
        count = len(results["seen"])
        say(f"Of {count} things that the text says one should see, {count - len(unseen)} are seen.")
    say("")
    counts = [[chapter.name, str(sum(chapter.counts.values())), _counted(chapter.counts)] for chapter in done]
    say("\n".join(aligned(("chapter", "numbers", "verdicts"), counts)))
    for entry in unseen:
        say("\n".join(wrapped(f"Not seen: {entry['says']} ({entry['section']}): {entry['why']}")))
    others = [entry for entry in results["numbers"] if entry["verdict"] != "same"]
    if everything and others:
        say("")
        say("\n".join(aligned(("number", "printed", "ours", "verdict", "why"), list(_rows(others)))))
    elif others:
        say(f"More with --all: the {len(others)} numbers that are not the same, each with why.")
    if folder is not None:
        say(f"Report: {folder / 'thesis.html'}")


def _counted(verdicts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items() if count)


def _rows(numbers: Iterable[Mapping[str, Any]]) -> Iterator[list[str]]:
    """A row for those of one place that have one verdict for one reason."""
    for (place, quantity, verdict, why), group in itertools.groupby(numbers, key=itemgetter(*_ROW)):
        first, *more = group
        entry, others = f", {first['entry']}" * bool(first["entry"]), f" and {len(more)} more" * bool(more)
        ours = "-" if first["ours"] is None else f"{first['ours']:.4g}"
        yield [f"{place}: {quantity}{entry}{others}", first["printed"], ours, verdict, why]
