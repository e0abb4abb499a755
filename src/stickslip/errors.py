"""The errors a user can meet; each one is a sentence: the value, the rule it breaks, the next step."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

MISSTATED = "delimiter"  # stated otherwise than the file has it
TOO_SHORT = "too short"  # of a record
ABSENT = "no such column"  # of a file, or channel of a record: one asked for by name or number
UNNAMED = "no column named"  # of a record whose columns may be recognised
NO_RATE = "no sampling rate"  # the kind of error where nothing states one
INTERRUPTED = 130  # exit code of a program that SIGINT ended: 128 + 2


class StickslipError(Exception):
    """Base of every error that stickslip raises on purpose.

    Parameters
    ----------
    value : str
        What was found, with its number ("channel x has 10 samples").
    rule : str
        What is needed instead ("friction loops need one full cycle").
    next_step : str
        What the user can do now ("give a longer record").
    kind : str
        What code asks for, where it goes on differently; a name that is not there is wrong use.
    options : sequence of str
        The words that mend a command which ended in it, beside those that were typed.

    Examples
    --------
    >>> print(RecordError("x has 10 samples", "a loop needs a full cycle", "give a longer record"))
    x has 10 samples; a loop needs a full cycle; give a longer record.
    """

    exit_code = 1

    def __init__(self, value: str, rule: str, next_step: str, *, kind: str = "", options: Sequence[str] = ()) -> None:
        super().__init__(value, rule, next_step)
        self.value, self.rule, self.next_step, self.kind, self.options = value, rule, next_step, kind, options
        if kind == ABSENT:
            self.exit_code = ModelError.exit_code

    def __str__(self) -> str:
        sentence = "; ".join(part.strip().rstrip(".;") for part in self.args)
        return " ".join(sentence.split()) + "."


class RecordError(StickslipError):
    """The record lacks, or contradicts, what was asked of it."""


class FormatError(StickslipError):
    """A file can not be read as the format that it seems, or claims, to be."""


class EstimateError(StickslipError):
    """The data can not support the estimate that was asked for."""


class ModelError(StickslipError):
    """A parameter of a rig or model has no meaning (a negative mass, a typo in a settings file)."""

    exit_code = 2
    parameter = ""  # its name, where the error is of one

    def of(self, parameter: str) -> ModelError:
        """The error, said of a parameter: whoever reads it from a file names its line."""
        self.parameter = parameter
        return self


class SolveError(StickslipError):
    """A simulation can not go on, or can not be trusted (too many events, transitions that chase each other)."""


def interruption(error: KeyboardInterrupt) -> str:
    """The sentence that Ctrl-C ends in: what the interruption itself says is left, or that there is nothing.

    Parameters
    ----------
    error : KeyboardInterrupt
        Its argument, if any, says what stands on the disk.

    Returns
    -------
    str

    Examples
    --------
    >>> interruption(KeyboardInterrupt())
    'stickslip: interrupted; nothing was written.'
    """
    return f"stickslip: interrupted; {str(error) or 'nothing was written'}."


def package(module: str, *, extra: str, rule: str, error: type[StickslipError] = ModelError) -> Any:
    """A module of a package that an extra brings, imported where it is used; without it an error says how to get it.

    Parameters
    ----------
    module : str
        Its dotted name.
    extra : str
        The extra of stickslip that brings it.
    rule : str
        What it is needed for.
    error : type of StickslipError
        What is raised.

    Returns
    -------
    module

    Raises
    ------
    StickslipError
        The package is not installed.

    Examples
    --------
    >>> package("no_such_package", extra="io", rule="it reads this format")
    Traceback (most recent call last):
    stickslip.errors.ModelError: the package no_such_package is not installed; it reads this format; install it with: \
pip install ".[io]" in the checkout.
    """
    try:
        return importlib.import_module(module)
    except ImportError as absent:
        value = f"the package {module.partition('.')[0]} is not installed"
        raise error(value, rule, f'install it with: pip install ".[{extra}]" in the checkout') from absent
