"""The fast march, piece by piece on two phasors: due, guess, certify, step.

A piece is taken only where it is proved: which exit ends it, to rounding, and that none came before. Whatever is in
doubt is left to the general march of :mod:`stickslip.solve.kernel`, which takes the same piece by the certificates of
:mod:`stickslip.solve.roots`.

* due: an exit that is above zero at the start is taken at once. A value within its rounding counts as zero, and its
  first derivative that is not decides; where the second is not to be told from zero either, the general march decides.
* guess: motion repeats itself nearly, so the same piece of the lap before tells when and by which exit this one ends.
  Where it tells nothing, looks along the way find an exit that has risen, and at last the piece may outlast the run.
* certify: a guess is only a place to start from. Halley's steps bring it to the zero of its exit, and a bound from both
  ends of each of some intervals shows that no exit was above zero before.
* step: the piece is written down, and the state, the clock and the lap's memory go on to its end.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array, Index
from stickslip.compiled import FAST, OPTIONS, compiled
from stickslip.solve.cells import Linear
from stickslip.solve.phasors import CARRIES, STOPS, Phasors, drive_of, slide_of, way_out
from stickslip.solve.roots import NOISE

HISTORY = 4096  # pieces remembered, a power of two; the guess is one lap old
SPLITS = 64  # intervals of a certificate at most; a piece that needs more is nearly tangent to an exit
LOOK = 0.4  # rad between two looks for an exit of which the lap before tells nothing
MOST_EXITS, MOST_AT_ONCE = 8, 8  # of a mode, for which there is scratch; and exits taken without time between
EXACT = 64  # pieces after which the drive's phasor is set anew: each turn of it leaves a rounding
NEARLY = 0.999  # of the time that is left: an exit so near the limit is left to the general march
BEFORE, LOOKED, LASTS = range(3)  # guesses, in the order in which they are tried
# what is kept of each exit during a piece: G, D, W, the value and three derivatives at the start, a bound of the fourth
# derivative, and the value at the last look
LEVEL, DRIVE, FREE, VALUE, RATE, BEND, JERK, FOURTH, SEEN = 0, 1, 3, 5, 6, 7, 8, 9, 10


class Model(NamedTuple):
    """What moves, as the kernels read it: its tables, those of the fast path, and the drive's period [s].

    Of many systems all have a leading axis.
    """

    linear: Linear
    fast: Phasors
    period: Any


class Clock(NamedTuple):
    """A time: laps of the drive, time [s] within the lap, and what rounding took from it."""

    laps: float
    time: float
    rest: float


class Past(NamedTuple):
    """A ring of pieces gone by: mode, exit, duration and parts of the certificate of each; and places in it."""

    modes: Index
    exits: Index
    times: Array
    parts: Index
    places: Index


NEXT, GUESS, LAP = range(3)  # places in a ring: of the next piece, of the one a lap ago, and of the lap's first


class Pieces(NamedTuple):
    """Room for pieces: start (laps, time within the lap), mode, duration, state at the start, exit that ended it (-1:
    the time was over)."""

    laps: NDArray[np.int32]
    offsets: Array
    modes: NDArray[np.int16]
    durations: Array
    states: Array
    exits: NDArray[np.int16]

    def part(self, begin: int, end: int) -> Pieces:
        """Some of them."""
        return Pieces._make(column[begin:end] for column in self)


class Here(NamedTuple):
    """Where the motion is: displacement, velocity, and the drive's phasor."""

    x: float
    v: float
    drive: complex


class Free(NamedTuple):
    """The free motion of a piece at its start: its phasor and that one's modulus, its centre, the phasor's rounding."""

    start: complex
    size: float
    centre: float
    noise: float


class End(NamedTuple):
    """How a piece ends: whether that is proved, when [s], by which exit (-1: by none before the limit), in how many
    intervals it is proved, and how far drive and free motion turn until then."""

    proved: bool
    time: float
    leaving: int
    parts: int
    drive: complex
    free: complex


def blank_past() -> Past:
    """The ring of pieces before the first one."""
    none = np.full((2, HISTORY), -1, np.int64)
    return Past(none[0], none[1], np.zeros(HISTORY), np.ones(HISTORY, np.int64), np.zeros(3, np.int64))


def blank_pieces(shape: tuple[int, ...], size: int) -> Pieces:
    """Room for pieces of a state of so many entries."""
    laps, modes, exits = (np.zeros(shape, kind) for kind in (np.int32, np.int16, np.int16))
    return Pieces(laps, np.zeros(shape), modes, np.zeros(shape), np.zeros((*shape, size)), exits)


@compiled(**OPTIONS, forceinline=True)
def until(clock, limit, period):
    """Time [s] from a clock to a limit; without a period both have no laps."""
    left = (limit.laps - clock.laps) * period if limit.laps != clock.laps else 0.0
    return left + (limit.time - clock.time)


@compiled(**OPTIONS, forceinline=True)
def later(clock, time, period):
    """The clock after a time, with what rounding takes from it, wrapped at the period."""
    step = time - clock.rest
    now = clock.time + step
    rest = (now - clock.time) - step
    if now < period:
        return Clock(clock.laps, now, rest)
    whole = 1.0 if now < 2.0 * period else float(math.floor(now / period))  # a piece of the fast path ends in the next
    return Clock(clock.laps + whole, now - whole * period, rest)


@compiled(**OPTIONS, forceinline=True)
def remember(past, mode, leaving, time, parts):
    """Put a piece into the ring; the guess goes on with it."""
    slot = past.places[NEXT]
    past.modes[slot], past.exits[slot], past.times[slot], past.parts[slot] = mode, leaving, time, parts
    past.places[NEXT] = (slot + 1) & (past.modes.shape[0] - 1)
    past.places[GUESS] = (past.places[GUESS] + 1) & (past.modes.shape[0] - 1)


@compiled(**OPTIONS, forceinline=True)
def new_lap(past):
    """A lap begins: its guesses are the pieces of the one that has ended."""
    past.places[GUESS] = past.places[LAP]
    past.places[LAP] = past.places[NEXT]


@compiled(**FAST, forceinline=True)
def _turned(nodes, turn, t):
    """e^{rate t} from the nearest node; `nodes` is (K, 3) as in ``Phasors``, t in s."""
    j = min(turn.nodes - 1, int(t * turn.density + 0.5))
    r = t - nodes[turn.first + j, 2]
    # within HALF_STEP of a node: the series to degree 9 leave 1e-17
    z = turn.rate.imag * r
    q = z * z
    c = 1.0 + q * (-0.5 + q * (1 / 24 + q * (-1 / 720 + q * (1 / 40320))))
    s = z * (1.0 + q * (-1 / 6 + q * (1 / 120 + q * (-1 / 5040 + q * (1 / 362880)))))
    if turn.rate.real != 0.0:
        y = turn.rate.real * r
        # of a weak decay the term of order six is below 1e-22
        e = 1 / 120
        if abs(y) > 5e-4:
            e += y * (1 / 720 + y * (1 / 5040 + y * (1 / 40320 + y * (1 / 362880))))
        e = 1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * e))))
        c *= e
        s *= e
    return complex(nodes[turn.first + j, 0], nodes[turn.first + j, 1]) * complex(c, s)


@compiled(**FAST, forceinline=True)
def _freely(nodes, own, t):
    """How far the free motion of a mode has turned; a mass that is held has none."""
    return _turned(nodes, own.free, t) if own.free.nodes > 0 else complex(0.0, 0.0)


@compiled(**FAST, forceinline=True)
def _derived(level, d, w, omega, rate):
    """Value and three derivatives of level + Re(d e^{i omega t}) + Re(w e^{rate t}) at t = 0."""
    a = rate * w
    b = rate * a
    jerk = omega * omega * omega * d.imag + (rate * b).real
    return level + d.real + w.real, a.real - omega * d.imag, b.real - omega * omega * d.real, jerk


@compiled(**FAST, forceinline=True)
def _later(piece, q, drive, free, omega, rate):
    """Value and derivatives of exit q where drive and free motion have turned so far."""
    d = complex(piece[q, DRIVE], piece[q, DRIVE + 1]) * drive
    w = complex(piece[q, FREE], piece[q, FREE + 1]) * free
    return _derived(piece[q, LEVEL], d, w, omega, rate)


@compiled(**FAST, forceinline=True)
def _parted(fast, own, mode, here, state, omega):
    """The motion from here on, less what the drive forces: free motion about a centre."""
    if not own.slides:
        return Free(complex(0.0, 0.0), 0.0, 0.0, 0.0)
    force = 0.0
    for i in range(fast.level.shape[1]):
        force += fast.level[mode, i] * state[2 + i]
    centre = force * own.softness
    forced = own.forced * here.drive
    zr = here.x - centre - forced.real
    zi = -(here.v + omega * forced.imag - own.free.rate.real * zr) * own.swing
    reach = abs(here.x) + abs(centre) + own.reach
    speed = abs(here.v) + omega * own.reach + abs(own.free.rate.real) * reach
    return Free(complex(zr, zi), math.sqrt(zr * zr + zi * zi), centre, NOISE * (reach + speed * own.swing))


@compiled(**FAST, forceinline=True)
def _due(model, own, mode, here, free, state, omega, piece):
    """Due: the exit that ends the mode at once (-1: none), and whether one is too close to call.

    Where none is, `piece` (MOST_EXITS, 16) has a row for each exit, in the columns from LEVEL on; `state` is (N,).
    """
    fast, first = model.fast, model.linear.first
    for q in range(first[mode + 1] - first[mode]):
        e = first[mode] + q
        way = way_out(fast, e)
        # G: what rests; of a mass that is held, its displacement and velocity too
        level, scale = 0.0, 0.0
        for i in range(fast.level.shape[1]):
            term = fast.rest[e, i] * state[2 + i]
            level += term
            scale += abs(term)
        if not own.slides:
            level += way.x * here.x + way.v * here.v
            scale += abs(way.x * here.x)
        # D and W, turned to the start of the piece, and the Taylor coefficients there
        d, w = way.drive * here.drive, way.free * free.start
        g, rate, bend, jerk = _derived(level, d, w, omega, own.free.rate)
        # the first that is not zero within its rounding decides, as roots.opening_order has it
        doubt = way.free_size * free.noise
        sure = g
        if abs(g) <= NOISE * (scale + way.drive_size) + doubt:
            g, sure = 0.0, rate
            if abs(rate) <= NOISE * way.drive_size * omega + doubt * own.speed:
                rate, sure = 0.0, bend
                if abs(bend) <= NOISE * way.drive_size * omega * omega + doubt * own.speed * own.speed:
                    return -1, True
        if sure > 0.0:
            return e, model.linear.crossing[e]  # whether a crossing counts hangs on what was before: in doubt
        piece[q, LEVEL], piece[q, DRIVE], piece[q, DRIVE + 1] = level, d.real, d.imag
        piece[q, FREE], piece[q, FREE + 1] = w.real, w.imag
        piece[q, VALUE], piece[q, RATE], piece[q, BEND], piece[q, JERK] = g, rate, bend, jerk
        # |g''''| <= |D| omega^4 + |W| |l|^4, as long as the free motion does not grow
        fourth = way.drive_size * omega * omega * omega * omega
        piece[q, FOURTH] = fourth + way.free_size * free.size * own.speed * own.speed * own.speed * own.speed
    return -1, False


@compiled(**FAST, forceinline=True)
def _looked(nodes, drive, own, piece, exits, longest):
    """Near which time some exit first rises through zero, and which: looks at some distance, only to start from.

    (-1, 0) where none is seen. What lies between two looks is not seen, and left to the certificate. `longest` is in s.
    """
    # LOOK by whichever of the two phasors turns faster
    step = LOOK / max(drive.rate.imag, own.speed)
    count = int(longest / step) + 1
    for j in range(1, count + 1):
        t, best, which = min(j * step, longest), 2.0 * longest, 0
        n, m = _turned(nodes, drive, t), _freely(nodes, own, t)
        for q in range(exits):
            g = piece[q, LEVEL] + piece[q, DRIVE] * n.real - piece[q, DRIVE + 1] * n.imag
            g += piece[q, FREE] * m.real - piece[q, FREE + 1] * m.imag
            # the first look has the value at the start before it
            before = piece[q, VALUE] if j == 1 else piece[q, SEEN]
            piece[q, SEEN] = g
            if g > 0.0:
                # the chord's zero; of a rise from zero itself there is none
                near = t - step * g / (g - before) if before < 0.0 else t
                if near < best:
                    best, which = near, q
        if best < 2.0 * longest:
            return best, which
    return -1.0, 0


@compiled(**FAST, forceinline=True)
def _guessed(kind, model, own, drive, mode, piece, past, left):
    """Guess: when a piece ends (-1: no such guess), by which exit, and in how many intervals it was proved before."""
    if kind == LASTS:
        return left if 0.0 < left < NEARLY * model.period else -1.0, -1, 1
    longest, first = NEARLY * min(left, model.period), model.linear.first[mode]
    if kind == BEFORE:
        slot = past.places[GUESS]
        leaving = past.exits[slot]
        t = past.times[slot] if past.modes[slot] == mode and leaving >= 0 else -1.0
        parts = past.parts[slot]
    else:
        t, q = _looked(model.fast.nodes, drive, own, piece, model.linear.first[mode + 1] - first, longest)
        leaving, parts = first + q, 1
    return t if 0.0 < t < longest else -1.0, leaving, parts


@compiled(**FAST, forceinline=True)
def _polished(nodes, drive, own, piece, k, t):
    """Halley's steps onto the zero of exit k: whether they end there, the time, and how far both have turned."""
    n, m = complex(1.0, 0.0), complex(0.0, 0.0)
    omega, rate = drive.rate.imag, own.free.rate
    for _ in range(6):
        n, m = _turned(nodes, drive, t), _freely(nodes, own, t)
        g, d, h, _ = _later(piece, k, n, m, omega, rate)
        step = -2.0 * g * d / (2.0 * d * d - g * h)
        # not onto a rise, or far from the guess: another exit, or none
        if not (d > 0.0 and abs(step) < 0.2 * t):
            break
        t += step
        # it converges cubically: (2e-6)^3 is below rounding
        if abs(step) * max(omega, own.speed) < 2e-6:
            # the phasors follow the last correction by their Taylor polynomials
            z = omega * step
            n = complex(n.real - z * n.imag - 0.5 * z * z * n.real, n.imag + z * n.real - 0.5 * z * z * n.imag)
            p, q = rate.real * step, rate.imag * step
            p, q = p + 0.5 * (p * p - q * q), q + p * q
            m = complex(m.real + p * m.real - q * m.imag, m.imag + p * m.imag + q * m.real)
            return True, t, n, m
    return False, t, n, m


@compiled(**FAST, forceinline=True)
def _below(g, d, h, j, fourth, length):
    """Whether g + d t + h t^2/2 + j t^3/6 + fourth t^4/24 stays below zero on (0, length]: Bernstein coefficients."""
    a, b, c = d * length, h * length * length, j * length * length * length
    e = fourth * length * length * length * length
    return (
        (g <= 0.0)
        & (g + 0.25 * a <= 0.0)
        & (g + 0.5 * a + b * (1 / 12) <= 0.0)
        & (g + 0.75 * a + 0.25 * b + c * (1 / 24) <= 0.0)
        & (g + a + 0.5 * b + c * (1 / 6) + e * (1 / 24) < 0.0)
    )


@compiled(**FAST, forceinline=True)
def _clear(nodes, drive, own, piece, exits, last, end, parts):
    """Certify: whether every exit stays below zero before the end, by bounds from both ends of `parts` intervals.

    A Taylor polynomial of degree four whose last coefficient is a bound lies above the exit. The one that ends the
    piece, number `last`, is zero there by its polish.
    """
    half = 0.5 * end.time / parts
    omega, rate = drive.rate.imag, own.free.rate
    # a growing free motion exceeds the bound taken at its start
    spread = math.exp(1.000001 * rate.real * end.time) if rate.real > 0.0 else 1.0
    for j in range(parts, -1, -1):
        n, m = end.drive, end.free
        if 0 < j < parts:
            at = end.time * j / parts
            n, m = _turned(nodes, drive, at), _freely(nodes, own, at)
        for q in range(exits):
            fourth = piece[q, FOURTH] * spread
            # the start, by the values that `due` took for zero where rounding decides
            if j == 0:
                if not _below(piece[q, VALUE], piece[q, RATE], piece[q, BEND], piece[q, JERK], fourth, half):
                    return False
                continue
            g, d, h, jerk = _later(piece, q, n, m, omega, rate)
            if j == parts:
                # the rounding of its polish is no crossing
                if q == last:
                    g = 0.0
            elif not _below(g, d, h, jerk, fourth, half):
                return False
            # back in time, where odd derivatives change sign
            if not _below(g, -d, h, -jerk, fourth, half):
                return False
    return True


@compiled(**FAST, forceinline=True)
def _tried(kind, model, own, drive, mode, piece, past, left):
    """Guess and certify: how the piece ends, if this guess is right."""
    nodes, first = model.fast.nodes, model.linear.first[mode]
    exits, none = model.linear.first[mode + 1] - first, complex(0.0, 0.0)
    # Guess.
    t, leaving, parts = _guessed(kind, model, own, drive, mode, piece, past, left)
    if not t > 0.0:
        return End(False, 0.0, -1, 1, none, none)
    # Certify: by the limit, or by the polished zero of the exit guessed.
    if kind == LASTS:
        sure, n, m, last = True, _turned(nodes, drive, t), _freely(nodes, own, t), -1
    else:
        last = leaving - first
        sure, t, n, m = _polished(nodes, drive, own, piece, last, t)
        # next to the limit, or longer than a lap: the general march's
        sure = sure and t < 0.9999 * left and t < model.period
    end = End(True, t, leaving, parts, n, m)
    # a bound of fourth order: half the interval has a sixteenth of its slack
    while sure and parts <= SPLITS and not _clear(nodes, drive, own, piece, exits, last, end, parts):
        parts *= 2
    return End(sure and parts <= SPLITS, t, leaving, parts, n, m)


@compiled(**FAST)
def _otherwise(model, own, drive, mode, piece, past, left):
    """As :func:`_tried` with the guesses that follow when the lap before tells nothing.

    Their kinds are numbers here, not constants: numba would compile each anew, and this is seldom called.
    """
    none = complex(0.0, 0.0)
    end = End(False, 0.0, -1, 1, none, none)
    for kind in range(LOOKED, LASTS + 1):
        end = _tried(kind, model, own, drive, mode, piece, past, left)
        if end.proved:
            break
    return end


@compiled(**FAST, forceinline=True)
def _write(out, count, clock, mode, here, state, end):
    """Write a piece down; of a state the displacement and velocity are `here`, the rest stands where it did."""
    out.laps[count], out.offsets[count], out.modes[count] = clock.laps, clock.time, mode
    out.durations[count], out.exits[count] = end.time, end.leaving
    out.states[count, 0], out.states[count, 1] = here.x, here.v
    for i in range(2, out.states.shape[1]):
        out.states[count, i] = state[i]


@compiled(**FAST, forceinline=True)
def _stepped(own, here, free, omega, freely, drive):
    """Step: where the motion is when it has turned so far, and the drive stands there."""
    if not own.slides:
        return Here(here.x, here.v, drive)
    forced, freed = own.forced * drive, free.start * freely
    rate = own.free.rate
    v = -omega * forced.imag + rate.real * freed.real - rate.imag * freed.imag
    return Here(free.centre + forced.real + freed.real, v, drive)


@compiled(**FAST, forceinline=True)
def _ticked(clock, end, limit, period, past):
    """The clock at the end of a piece; where a lap begins, so do its guesses."""
    now = later(clock, end.time, period)
    if end.leaving < 0:
        now = Clock(limit.laps, limit.time, 0.0)
    if now.laps > clock.laps:
        new_lap(past)
    return now


@compiled(**FAST, forceinline=True)
def _left(model, e, here, state, fresh):
    """What an exit leaves of the motion: the mass may stop, and the memory take new values."""
    deed = way_out(model.fast, e).deed
    if deed == STOPS:
        return Here(here.x, 0.0, here.drive)
    if deed == CARRIES:
        _put(here, state)
        _carry(model.linear.reset[e], state, fresh)
        return Here(here.x, state[1], here.drive)
    return here


@compiled(**FAST, forceinline=True)
def _put(here, state):
    """Write where the motion is into the state."""
    size = state.shape[0]
    state[0], state[1], state[size - 2], state[size - 1] = here.x, here.v, here.drive.real, here.drive.imag


@compiled(**FAST)
def _carry(matrix, state, fresh):
    """Take the velocity and the memory over an exit; displacement and drive go on."""
    size = state.shape[0]
    for i in range(1, size - 3):
        total = 0.0
        for q in range(size):
            total += matrix[i, q] * state[q]
        fresh[i] = total
    for i in range(1, size - 3):
        state[i] = fresh[i]


@compiled(**FAST)
def glide(model, clock, state, mode, limit, past, out, count, work):
    """March by phasors as far as every piece is certified.

    Parameters
    ----------
    model, clock, state, mode, limit, past, out
        As in :func:`stickslip.solve.kernel.march`.
    count : int
        Pieces already in `out`.
    work : ndarray (9, 16 or more)
        Scratch.

    Returns
    -------
    tuple of (int, int, bool, Clock)
        Number of pieces in `out`, the mode, whether time passes in it (else the general march settles it), and the
        clock. The next piece is the general march's.
    """
    piece, fresh = work[:MOST_EXITS], work[MOST_EXITS]
    size, capacity = state.shape[0], out.laps.shape[0]
    drive, phase = drive_of(model.fast), model.fast.drive[1]
    omega = drive.rate.imag
    here = Here(state[0], state[1], complex(state[size - 2], state[size - 1]))
    since, chain, settled = 0, 0, False
    while chain < MOST_AT_ONCE:
        if model.linear.first[mode + 1] - model.linear.first[mode] > MOST_EXITS:
            break
        # Due: what is above zero already is taken without time.
        own = slide_of(model.fast, mode)
        free = _parted(model.fast, own, mode, here, state, omega)
        leaving, doubtful = _due(model, own, mode, here, free, state, omega, piece)
        if doubtful:
            break
        if leaving < 0:
            # time passes here, but there is no room for the piece
            settled = count == capacity
            if settled:
                break
            left = until(clock, limit, model.period)
            # Guess and certify.
            end = _tried(BEFORE, model, own, drive, mode, piece, past, left)
            if not end.proved:
                end = _otherwise(model, own, drive, mode, piece, past, left)
            if not end.proved:
                break
            # Step.
            _write(out, count, clock, mode, here, state, end)
            count += 1
            remember(past, mode, end.leaving, end.time, end.parts)
            clock = _ticked(clock, end, limit, model.period, past)
            since += 1
            turned = here.drive * end.drive
            # a product of turns gathers rounding: by the clock anew
            if since >= EXACT:
                angle = omega * clock.time + phase
                turned, since = complex(math.cos(angle), math.sin(angle)), 0
            here = _stepped(own, here, free, omega, end.free, turned)
            # by no exit: this was the limit
            settled = end.leaving < 0
            if settled:
                break
            leaving, chain = end.leaving, -1
        # Exit: what it leaves, and the mode behind; `chain` counts those without time between.
        here = _left(model, leaving, here, state, fresh)
        mode = model.linear.target[leaving]
        chain += 1
    _put(here, state)
    return count, mode, settled, clock
