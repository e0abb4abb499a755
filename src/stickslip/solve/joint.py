"""The modes of several contacts at once: a mode of every contact, and only those that can be reached.

The exits of a joint mode are the exits of all its contacts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode

MOST = 4096  # joint modes; more would not fit a desk


@dataclass(frozen=True)
class JointMode(Mode):
    """A mode of every contact at once, named after them; its side is that of the first contact that slides.

    Attributes
    ----------
    parts : tuple of Mode
        The mode of each contact.
    owners : tuple of int
        Number of the contact that each exit belongs to.
    """

    parts: tuple[Mode, ...] = ()
    owners: tuple[int, ...] = ()

    @classmethod
    def of(cls, parts: tuple[Mode, ...], taken: list[tuple[Exit, int]]) -> JointMode:
        """The joint mode of some parts, with the exits that end it and the contacts these belong to."""
        return cls(
            name=" + ".join(part.name for part in parts) or "free",
            kind=" + ".join(part.kind for part in parts) or "free",
            side=next((part.side for part in parts if part.side), 0),
            friction=None if parts and all(part.friction is None for part in parts) else {},
            exits=tuple(exit_ for exit_, _ in taken),
            parts=parts,
            owners=tuple(owner for _, owner in taken),
        )

    def changes(self, before: Mode, leaving: int) -> Iterator[tuple[int, Mode, Mode]]:
        """Each contact whose mode has changed, and the one whose exit it was."""
        if not isinstance(before, JointMode):
            raise TypeError(f"{before.name} is no mode of several contacts")
        for contact, (old, new) in enumerate(zip(before.parts, self.parts, strict=True)):
            if old is not new or contact == before.owners[leaving]:
                yield contact, old, new


class Joint(NamedTuple):
    """Number of each contact's mode; contact and number (within its mode) of each exit, and the joint mode behind."""

    numbers: tuple[int, ...]
    exits: list[tuple[int, int]]
    targets: list[int]


def reached(tables: Sequence[Sequence[Mode]], seeds: Sequence[tuple[str, ...]]) -> list[Joint]:
    """The joint modes that follow from some: a mode's name for every contact.

    Where a contact is landing no time passes, and none but its own exits are asked.
    """
    known = [{mode.name: number for number, mode in enumerate(table)} for table in tables]
    order = {tuple(own[name] for own, name in zip(known, seed, strict=True)): j for j, seed in enumerate(seeds)}
    waiting = list(order)
    joints: list[Joint] = []
    for numbers in waiting:
        parts = [table[number] for table, number in zip(tables, numbers, strict=True)]
        landing = [c for c, part in enumerate(parts) if part.kind == "landing"]
        exits = [(c, e) for c in landing[:1] or range(len(parts)) for e in range(len(parts[c].exits))]
        joints.append(Joint(numbers, exits, []))
        for c, e in exits:
            following = (*numbers[:c], known[c][parts[c].exits[e].to], *numbers[c + 1 :])
            if following not in order:
                if len(order) == MOST:
                    raise ModelError(
                        f"{len(tables)} contacts with more than {MOST} joint modes",
                        f"at most {MOST} are built",
                        "join contacts, or leave those that hardly move out",
                    )
                order[following] = len(order)
                waiting.append(following)
            joints[-1].targets.append(order[following])
    return joints


def numbered(name: str, count: int) -> tuple[str, ...]:
    """The name alone for one, else name1, name2 ..."""
    return (name,) if count == 1 else tuple(f"{name}{j + 1}" for j in range(count))
