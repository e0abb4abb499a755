"""The program: its commands, and how an error ends it."""

from __future__ import annotations

import gc
import importlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.records import RIG_FILE
from stickslip.cli.terminal import ARGUMENTS, compiling, complain, say, spoken
from stickslip.errors import INTERRUPTED, MISSTATED, TOO_SHORT, UNNAMED, StickslipError, interruption

COMMANDS = {  # by the file that they stand in
    "analyze": ("analyze", "demo", "fit", "impact", "predict"),
    "bench": ("acquire", "commission", "devices", "simulated_bench"),
    "files": ("check", "convert", "datasets", "init"),
    "rig": ("rig", "thesis"),
    "simulate": ("bifurcation", "dither", "lab", "simulate", "stability", "sweep"),
    "vibrations": ("decay", "joint", "squeak", "tribometer", "wavelet"),
}
# Of each kind of error the options without which the command may succeed.
CAUSES = {MISSTATED: ("--delimiter", "--decimal"), TOO_SHORT: ("--rows",)}


class _Commands(click.Group):
    """Every error that stickslip raises on purpose ends as one sentence and its exit code."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """What is asked wrongly before any command is refused as within one."""
        ctx.meta[ARGUMENTS] = list(args)
        if not args:
            return super().parse_args(ctx, args)  # shows the help
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            ctx.exit(_misused(error, ctx.command_path))

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with compiling():
                return super().invoke(ctx)
        except KeyboardInterrupt as error:
            say(interruption(error), err=True)
            ctx.exit(INTERRUPTED)
        except click.UsageError as error:
            within = " ".join(filter(None, (ctx.command_path, ctx.invoked_subcommand)))
            ctx.exit(_misused(error, error.ctx.command_path if error.ctx else within))
        except ss.StickslipError as error:
            complain(spoken(error))
            if remedy := self._remedy(ctx, error):
                say("To mend it:", err=True)
                say(shlex.join(["stickslip", *remedy]), err=True)
            ctx.exit(error.exit_code)
        except OSError as error:  # a name that the system does not take, a disk that is full
            if error.filename is None:
                raise
            complain(f"'{error.filename}' can not be used; {error.strerror}; name another file or folder.")
            ctx.exit(1)

    def _remedy(self, ctx: click.Context, error: StickslipError) -> list[str]:
        """The command that mends an error: it asks for columns, or is this one less an option or with more of them.

        Empty if none does.
        """
        arguments = ctx.meta.get(ARGUMENTS, [])
        if error.kind == UNNAMED:
            name, command, rest = self.resolve_command(ctx, list(arguments))
            return (
                _naming(command.make_context(name, rest, parent=ctx, resilient_parsing=True).params) if command else []
            )
        kept = list(_without(arguments, CAUSES.get(error.kind, ())))
        return [*kept, *error.options] if error.options or len(kept) < len(arguments) else []


def _misused(error: click.UsageError, command: str) -> int:
    complain(f"{error.format_message().rstrip('.')}; see {command} --help.")
    return error.exit_code


def _naming(parameters: Mapping[str, Any]) -> list[str]:
    """The command that asks what the columns of a command's files are, and keeps what a file states of their rig."""
    files, stated = parameters.get("files", ()), parameters.get("config")
    if stated is None and Path(RIG_FILE).is_file():
        stated = Path(RIG_FILE)
    if not files:
        return []
    if stated is None:
        return ["init", *files]
    output = Path(f"{stated.stem}-columns.toml")
    named = bool(ss.rig.read_rig(stated).channels)
    return [] if named or output.exists() else ["init", *files, "--config", str(stated), "--output", str(output)]


def _without(arguments: Sequence[str], options: Sequence[str]) -> Iterator[str]:
    """The words but these options and their values."""
    rest = iter(arguments)
    for word in rest:
        if word in options:
            next(rest, None)
        elif word.partition("=")[0] not in options:
            yield word


# Most objects of a command live until its end: to look for garbage among them took 0.5 s of the demo's 7.
gc.set_threshold(100_000)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(ss.__version__, prog_name="stickslip")
def main() -> None:
    """How much friction is in this record, did the contact stick, and how sure is that?

    Exit codes: 0 done, 1 the data can not answer (and why), 2 wrong use. Of several files, those that can not answer
    are named and left out; the exit code is 1 where none is left.
    """


for _file, _names in COMMANDS.items():
    for _name in _names:
        main.add_command(getattr(importlib.import_module(f"stickslip.cli.{_file}"), _name))
