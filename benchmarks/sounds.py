"""Of sounds alone: which squeaks are found, and which claims that something rubs are false?

    python benchmarks/sounds.py --draws 200 --seed 1

Squeaks, creaks and what is neither (beeps, beats, fans, clicks, speech, music, hum) are drawn by
``tests/sound_sources.py``; squeaks of coupled modes, whines, flutes, birds, crickets, kettles and sirens in a room that
answers by ``tests/sound_strangers.py``. Neither has anything of the package; noise lies 0 to 30 dB below. A claim is an
answer that it squeaks, squeals or creaks; it is false where nothing rubs. A squeak is found where a tonal burst shares
more than half of its time; its pitch is right within 1 %.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import stickslip as ss

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import sound_strangers
from sound_sources import KINDS, RUBS, Sound, draw

CLAIMS = ("squeaks", "squeals", "creaks")
HEARD = 9.0  # dB over the noise, from which on squeaks are asked for


@dataclass
class Score:
    """Answers to the draws of a kind, squeaks from 9 dB on, and how many of them are found, pitched and claimed."""

    answers: Counter[str] = field(default_factory=Counter)
    squeaks: int = 0
    found: int = 0
    pitched: int = 0
    claimed: int = 0

    @property
    def claims(self) -> int:
        """Draws that are said to squeak, squeal or creak."""
        return sum(self.answers[claim] for claim in CLAIMS)


def heard(sound: Sound) -> ss.squeak.Squeaks:
    return ss.find_squeaks(ss.Record.of({"sound": sound.values}, fs=sound.fs, units={"sound": "1"}))


def measured(kind: str, draws: int, seed: int) -> Score:
    """Score of a kind's draws from `seed` on."""
    score = Score()
    for number in range(draws):
        sound = (draw if kind in KINDS else sound_strangers.draw)(kind, seed + number)
        answer = heard(sound)
        score.answers[answer.answer] += 1
        for begin, end, frequency in sound.squeaks if sound.snr >= HEARD else ():
            near = [
                burst
                for burst in answer.of("squeak", "squeal", "tonal")
                if min(end, burst.end) - max(begin, burst.start) > 0.5 * (end - begin)
            ]
            score.squeaks += 1
            score.found += bool(near)
            score.pitched += any(abs(burst.frequency / frequency - 1) < 0.01 for burst in near)
            score.claimed += any(burst.kind != "tonal" for burst in near)
    return score


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--draws", type=int, default=200)
    asked.add_argument("--seed", type=int, default=1)
    options = asked.parse_args()
    scores = {}
    for kind in (*KINDS, *sound_strangers.KINDS):
        score = scores[kind] = measured(kind, options.draws, options.seed)
        answers = ", ".join(f"{answer} {count}" for answer, count in score.answers.most_common())
        print(f"{kind:10} {answers}", flush=True)
    for kind in ("squeaks", "couplings"):
        score = scores[kind]
        shares = [count / score.squeaks for count in (score.found, score.pitched, score.claimed)]
        told = "found {:.1%}, pitch within 1 % {:.1%}, said to be squeaks {:.1%}".format(*shares)
        print(f"{kind} at {HEARD:g} dB and more: {score.squeaks}; {told}")
    for kinds in (KINDS, sound_strangers.KINDS):
        rubs = (*RUBS, *sound_strangers.RUBS)
        claims = sum(scores[kind].claims for kind in kinds)
        false = sum(scores[kind].claims for kind in kinds if kind not in rubs)
        print(f"claims that something rubs: {claims}, of which false {false} ({false / max(1, claims):.2%})")
