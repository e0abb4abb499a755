"""Questions asked one after the other: what came of them, where some have no answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from stickslip.errors import ModelError, StickslipError

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Asked:
    """What came of the questions so far: notes in words, and the errors behind those that failed.

    A question aside (how late a sensor is, whether two forces agree) helps the others along. Where it has no answer
    they are asked without it, and it is no reason why a record tells nothing.
    """

    notes: list[str] = field(default_factory=list)
    refusals: list[StickslipError] = field(default_factory=list)

    def ask(self, question: str, answer: Callable[[], Answer], *, aside: bool = False) -> Answer | None:
        """The answer; where the record can not give one, None and a note."""
        try:
            return answer()
        except ModelError:
            raise
        except StickslipError as error:
            self.notes.append(f"{question}: {error}")
            if not aside:
                self.refusals.append(error)
            return None
