"""The motions that a free decay may follow: one equation, and which of its terms are at work.

The motion of a free decay from turning point to turning point, with its sensitivities; compiled.

Between two turning points every candidate's equation is smooth. In the direction of motion, with ``u`` the displacement
from rest counted positive at the half cycle's beginning, ``A`` its value there and ``y = -u'`` the speed,

    u'' = -w^2 [r(u) + h + 2 kappa ((A - u) / 2)^(1 + p)] + w^2 x_k (1 + sigma exp(-y / v_s)) (1 + eta s / |a|)
          - w^2 (x_k - b) exp(-(A - u) / l) (1 - tau y / l) + 2 zeta w y + q y^2,

s the way slid since the release and a the first amplitude: friction that changes as it wears. The term in kappa is a
Masing branch of the backbone ``x - kappa x^(1 + p)`` (a joint in micro-slip, Segalman 2005); ``h`` is what the branches
before have left. That in l is a contact that yields before it slides (Dahl 1968; with tau LuGre's, Canudas de Wit
1995): its friction bears ``b`` at the turning point, against the motion that begins there, and x_k some l later.
Gragg's extrapolated midpoint rule (order eight) carries state and sensitivities; the turning point is found to
rounding; samples lie on quintics through position, speed and acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.compiled import OPTIONS, compiled

Restoring = Literal["linear", "pendulum"]
RESTORING: tuple[str, ...] = get_args(Restoring)

PARAMETERS = (
    "angular_frequency", "damping_ratio", "dry_displacement", "rest", "amplitude", "release",
    "quadratic", "rise", "stribeck_speed", "micro_slip", "exponent", "curvature", "wear", "presliding", "relaxation",
)  # fmt: skip
ALWAYS = ("angular_frequency", "rest", "amplitude", "release")

FREQUENCY, DAMPING, DRY, REST, AMPLITUDE, RELEASE = range(6)
QUADRATIC, RISE, SPEED, SLIP, EXPONENT, CURVATURE, WEAR, PRESLIDING, RELAXATION = range(6, 15)
WIDTH = len(PARAMETERS)

STEP = 0.2  # of a radian of the small motion
ROWS = 4  # of extrapolation: midpoint rules of 2, 4, 6 and 8 steps
LEAST = 1e-12  # of the first amplitude: where a motion that never stops is left
BORNE = 40.0  # pre-sliding displacements after which a contact bears all it can, to rounding
FINEST = 1e-7  # of the first amplitude: a shorter pre-sliding displacement is not resolved, or rounding would stop it
YIELDING = 0.5  # of one: greatest step at a turning point; 1 leaves 1e-6 of the amplitude, this 1e-9


@dataclass(frozen=True)
class Motion:
    """A candidate: the terms at work beside inertia and spring.

    Attributes
    ----------
    name : str
        As the choice among candidates calls it.
    terms : tuple of str
        The parameters that are free beside natural frequency, rest position, amplitude and release.
    words : str
        What it is, for a table.
    sticks_early : bool
        Whether it may stay at a turning point from which its kinetic friction would let it go on.
    """

    name: str
    terms: tuple[str, ...]
    words: str
    sticks_early: bool = False

    @property
    def free(self) -> tuple[str, ...]:
        """Every free parameter."""
        return (*ALWAYS, *self.terms)

    @property
    def stops(self) -> bool:
        """Whether it comes to rest at a turning point, after a whole number of half cycles."""
        return "dry_displacement" in self.terms and "presliding" not in self.terms

    def contains(self, other: Motion) -> bool:
        """Whether it is the other where its further terms are none; one that never stops is none that does."""
        return (
            set(other.terms) < set(self.terms) and other.sticks_early <= self.sticks_early and other.stops <= self.stops
        )

    @property
    def size(self) -> int:
        """How many terms it is made of."""
        return len(self.terms) + self.sticks_early


MOTIONS = {
    motion.name: motion
    for motion in (
        Motion("viscous", ("damping_ratio",), "viscous damping alone"),
        Motion("dry", ("dry_displacement",), "dry friction alone"),
        Motion("both", ("damping_ratio", "dry_displacement"), "viscous damping and dry friction"),
        Motion(
            "static",
            ("damping_ratio", "dry_displacement"),
            "viscous damping and dry friction, static above kinetic",
            sticks_early=True,
        ),
        Motion("air", ("damping_ratio", "quadratic"), "viscous and quadratic (air) damping, no dry friction"),
        Motion(
            "quadratic",
            ("damping_ratio", "dry_displacement", "quadratic"),
            "viscous damping, dry friction and quadratic (air) damping",
        ),
        Motion(
            "stribeck",
            ("damping_ratio", "dry_displacement", "rise", "stribeck_speed"),
            "viscous damping and dry friction that rises towards rest (Stribeck)",
        ),
        Motion(
            "micro-slip",
            ("damping_ratio", "micro_slip", "exponent"),
            "viscous damping and a joint in micro-slip, no dry friction",
        ),
        Motion(
            "curved spring",
            ("damping_ratio", "dry_displacement", "curvature"),
            "viscous damping and dry friction, spring that is not straight",
        ),
        Motion(
            "elastic contact",
            ("damping_ratio", "dry_displacement", "presliding", "relaxation"),
            "viscous damping and dry friction of a contact that yields before it slides",
        ),
    )
}

WORN = Motion(
    "worn",
    ("damping_ratio", "dry_displacement", "wear"),
    "viscous damping and dry friction that changes with the way slid (wear)",
)
"""No candidate: a falling level is hardly told from more damping. It is the doubt of those that it passes for."""


def free_decay(
    times: ArrayLike,
    parameters: ArrayLike,
    *,
    free: tuple[str, ...] = (),
    restoring: Restoring = "linear",
    half_cycles: int | None = None,
    spread: ArrayLike | None = None,
) -> tuple[Array, Array, int]:
    r"""Where is a released mass, and how does that depend on the parameters?

    ``x'' = -w^2 [r(x) + g x^3] - 2 zeta w v - w^2 x_k (1 + sigma exp(-|v| / v_s)) sgn v - q v |v| - w^2 joint``, with
    ``r = x`` or ``sin x``, released at rest, until the spring is no stronger than the friction. The joint is in
    micro-slip: its branch is Masing's, of the backbone ``-kappa x^(1 + p)`` (Segalman 2005), so the energy that it
    takes per cycle goes with the amplitude to the power 2 + p, and with it the natural frequency falls.

    With a pre-sliding displacement l the contact yields before it slides, with the stiffness ``k x_k / l`` (Dahl), and
    bears ``tau`` times the rate of that beside (LuGre); it never holds, and what is left rings on it.

    Parameters
    ----------
    times : array_like, shape (n,)
        Instants [s], rising.
    parameters : array_like, shape (12,) to (15,)
        In the order of ``PARAMETERS``: w [rad/s], zeta, x_k, rest position, first amplitude from there (signed),
        release [s], q [1/length], sigma, v_s, kappa [length^-p], p, g [1/length^2]; eta, by which x_k grows over a way
        of the first amplitude; l [length], tau [s]; 0 where left out.
    free : tuple of str
        Parameters whose sensitivities are wanted.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x.
    half_cycles : int, optional
        It stays at the turning point after so many, whatever drives it from there (static above kinetic friction).
    spread : array_like, shape (n,), optional
        Each value is the mean over a block of samples of this standard deviation in time [s] (to fourth order).

    Returns
    -------
    x : ndarray, shape (n,)
        Displacement.
    jacobian : ndarray, shape (n, len(free))
        Its derivatives.
    half_cycles : int
        Half cycles begun up to the last instant.

    Examples
    --------
    >>> dry = [2 * np.pi, 0.0, 0.05, 0.0, 1.0, 0.0, 0, 0, 0, 0, 0.5, 0]
    >>> free_decay([0.0, 0.5, 1.0], dry)[0].round(6).tolist()  # each half cycle loses 2 x_k
    [1.0, -0.9, 0.8]
    """
    instants = np.ascontiguousarray(times, dtype=float)
    if spread is not None:
        apart = np.asarray(spread, dtype=float)
        instants = np.stack([instants - apart, instants + apart], axis=1).ravel()
    active = np.array([PARAMETERS.index(name) for name in free], dtype=np.int64)
    work = np.empty((15, 2 + 2 * len(active)))
    x, jacobian = np.empty(len(instants)), np.empty((len(instants), len(active)))
    most = -1 if half_cycles is None else half_cycles
    values = np.zeros(WIDTH)
    values[: len(np.atleast_1d(parameters))] = parameters
    begun = decay(instants, values, active, restoring == "pendulum", most, work, x, jacobian)
    if spread is not None:
        x, jacobian = 0.5 * (x[::2] + x[1::2]), 0.5 * (jacobian[::2] + jacobian[1::2])
    return x, jacobian, int(begun)


@compiled(**OPTIONS)
def _rates(state, p, active, sine, branch, worn, bent, out):
    """Rates of ``state = (u, u', du/dp_j, du'/dp_j, ...)``; `branch` holds A, h and their sensitivities, `worn` the
    way slid before A and its, `bent` what a contact that yields bears at A and its.

    With k = `active.size` parameters, state, branch and `out` are (2 + 2 k,), worn and bent (1 + k,) or longer, `p`
    (WIDTH,), in s and the record's unit of length.
    """
    w, u, y = p[FREQUENCY], state[0], -state[1]
    square = w * w
    # Terms: Stribeck's rise of friction towards rest; none where it has no speed.
    decay = math.exp(-y / p[SPEED]) if p[SPEED] > 0 else 0.0
    # Masing: at half the way from the turning point; 0^(1 + p) by hand, as its logarithm is no number
    depth = 0.5 * (branch[0] - u)
    log = math.log(depth) if depth > 0 else 0.0
    power = math.exp((1 + p[EXPONENT]) * log) if depth > 0 else 0.0
    slope = p[SLIP] * (1 + p[EXPONENT]) * power / depth if depth > 0 else 0.0
    spring = (math.sin(u) if sine else u) + p[CURVATURE] * u**3 + branch[1] + 2 * p[SLIP] * power
    # wear: friction goes with the way slid, and never drives
    first, slid = abs(p[AMPLITUDE]), worn[0] + branch[0] - u
    fresh = p[DRY] * (1 + p[RISE] * decay)
    grown = p[WEAR] / first if p[WEAR] != 0 else 0.0
    level = max(0.0, 1 + grown * slid)
    grown = grown if level > 0 else 0.0  # what is worn away changes no more
    dry = fresh * level
    fade = level * p[DRY] * p[RISE] * decay / p[SPEED] if p[SPEED] > 0 else 0.0
    # Slopes of u'' by u and by y; y = -u', so that the second counts with the other sign below.
    by_u = -square * ((math.cos(u) if sine else 1.0) + 3 * p[CURVATURE] * u * u - slope + fresh * grown)
    by_y = -square * fade + 2 * p[DAMPING] * w + 2 * p[QUADRATIC] * y
    # yielding: what the contact does not bear yet goes with exp(-way / l), less what its damping bears
    length, way = p[PRESLIDING], branch[0] - u
    lacking, yields, unborne, stiffness = p[DRY] - bent[0], 0.0, 0.0, 0.0
    if length > 0 and way < BORNE * length:
        yields = math.exp(-way / length)
        unborne = yields * (1 - p[RELAXATION] * y / length)
        dry -= lacking * unborne
        stiffness = lacking * unborne / length
        by_u -= square * stiffness
        by_y += square * lacking * yields * p[RELAXATION] / length
    out[0] = state[1]
    out[1] = square * (dry - spring) + 2 * p[DAMPING] * w * y + p[QUADRATIC] * y * y
    # Sensitivities: by the parameter itself, then by A, h and the way slid, which the turns before have moved.
    for j in range(active.size):
        name = active[j]
        direct = 0.0
        if name == FREQUENCY:
            direct = 2 * w * (dry - spring) + 2 * p[DAMPING] * y
        elif name == DAMPING:
            direct = 2 * w * y
        elif name == DRY:
            direct = square * (level * (1 + p[RISE] * decay) - unborne)
        elif name == QUADRATIC:
            direct = y * y
        elif name == RISE:
            direct = square * level * p[DRY] * decay
        elif name == SPEED:
            direct = square * fade * y / p[SPEED] if p[SPEED] > 0 else 0.0
        elif name == SLIP:
            direct = -2 * square * power
        elif name == EXPONENT:
            direct = -2 * square * p[SLIP] * power * log
        elif name == CURVATURE:
            direct = -square * u**3
        elif name == WEAR:
            direct = square * fresh * slid / first if level > 0 else 0.0
        elif name == AMPLITUDE and grown != 0:
            direct = -square * fresh * grown * slid / p[AMPLITUDE]
        elif name == PRESLIDING and yields > 0:
            direct = -square * lacking * (unborne * way + yields * p[RELAXATION] * y) / length**2
        elif name == RELAXATION and yields > 0:
            direct = square * lacking * yields * y / length
        if grown != 0:
            direct += square * fresh * grown * (worn[1 + j] + branch[2 + 2 * j])
        if yields > 0:
            direct += square * (unborne * bent[1 + j] + stiffness * branch[2 + 2 * j])
        du, dv = state[2 + 2 * j], state[3 + 2 * j]
        out[2 + 2 * j] = dv
        out[3 + 2 * j] = (
            by_u * du - by_y * dv + direct - square * slope * branch[2 + 2 * j] - square * branch[3 + 2 * j]
        )


@compiled(**OPTIONS)
def _advance(state, length, p, active, sine, branch, rates, work, out):
    """One step of Gragg's rule of `length` [s], extrapolated; `rates` holds the rates at its beginning, `work` is
    (15, 2 + 2 k) as :func:`decay` parts it."""
    size = 2 + 2 * active.size
    rows = ROWS
    old, now, slopes = work[rows], work[rows + 1], work[rows + 2]
    # Midpoint rule of 2, 4, 6, 8 steps: its error has even powers of the step alone.
    for row in range(rows):
        count = 2 * (row + 1)
        short = length / count
        # the first step is Euler's: the midpoint rule needs two values
        for i in range(size):
            old[i] = state[i]
            now[i] = state[i] + short * rates[i]
        for _ in range(1, count):
            _rates(now, p, active, sine, branch, work[13], work[14], slopes)
            for i in range(size):
                next_ = old[i] + 2 * short * slopes[i]
                old[i] = now[i]
                now[i] = next_
        for i in range(size):
            work[row, i] = now[i]
    # Extrapolation (Aitken and Neville) in the step's square: each level gains two orders.
    for level in range(1, rows):
        for row in range(rows - 1, level - 1, -1):
            ratio = ((row + 1) / (row + 1 - level)) ** 2
            for i in range(size):
                work[row, i] += (work[row, i] - work[row - 1, i]) / (ratio - 1)
    for i in range(size):
        out[i] = work[rows - 1, i]


@compiled(**OPTIONS)
def _quintic(s, length, begin, begin_rate, end, end_rate, k):
    """Position number k (0 the motion, then its sensitivities) at the share s of a step."""
    a, b, c = begin[k], begin[k + 1] * length, begin_rate[k + 1] * length * length
    d, e, f = end[k], end[k + 1] * length, end_rate[k + 1] * length * length
    c3 = 10 * (d - a) - 6 * b - 4 * e - 1.5 * c + 0.5 * f
    c4 = -15 * (d - a) + 8 * b + 7 * e + 1.5 * c - f
    c5 = 6 * (d - a) - 3 * (b + e) - 0.5 * c + 0.5 * f
    return a + s * (b + s * (0.5 * c + s * (c3 + s * (c4 + s * c5))))


@compiled(**OPTIONS)
def _speed(s, length, begin, begin_rate, end, end_rate):
    """Velocity at the share s of a step, by the quintic's slope."""
    a, b, c = begin[0], begin[1] * length, begin_rate[1] * length * length
    d, e, f = end[0], end[1] * length, end_rate[1] * length * length
    c3 = 10 * (d - a) - 6 * b - 4 * e - 1.5 * c + 0.5 * f
    c4 = -15 * (d - a) + 8 * b + 7 * e + 1.5 * c - f
    c5 = 6 * (d - a) - 3 * (b + e) - 0.5 * c + 0.5 * f
    return (b + s * (c + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / length


@compiled(**OPTIONS)
def _turning_spring(branch, p, sine):
    """What drives the mass away from its turning point, over the stiffness."""
    return (math.sin(branch[0]) if sine else branch[0]) + p[CURVATURE] * branch[0] ** 3 + branch[1]


@compiled(**OPTIONS)
def _rest(sample, p, active, side, branch, x, jacobian):
    """A sample at rest on a turning point."""
    x[sample] = p[REST] + side * branch[0]
    for j in range(active.size):
        jacobian[sample, j] = side * branch[2 + 2 * j] + (1.0 if active[j] == REST else 0.0)


@compiled(**OPTIONS)
def _first_branch(p, active, side, branch, worn, bent, moved):
    """The branch from the first turning point, on the virgin backbone, and how its beginning `moved` (k,) by each
    parameter [s a unit]; the other arrays as in :func:`_rates`."""
    amplitude = abs(p[AMPLITUDE])
    log = math.log(amplitude) if amplitude > 0 else 0.0
    power = math.exp((1 + p[EXPONENT]) * log) if amplitude > 0 else 0.0
    # virgin backbone x - kappa x^(1 + p): h = -kappa A^(1 + p)
    branch[0], branch[1], worn[0] = amplitude, -p[SLIP] * power, 0.0
    bent[0] = -p[DRY]  # it was pulled there, against all that the contact bears
    for j in range(active.size):
        name = active[j]
        # A = side * amplitude, h by amplitude, kappa and p; nothing was slid before
        branch[2 + 2 * j] = side if name == AMPLITUDE else 0.0
        branch[3 + 2 * j] = worn[1 + j] = 0.0
        bent[1 + j] = -1.0 if name == DRY else 0.0
        if name == SLIP:
            branch[3 + 2 * j] = -power
        elif name == EXPONENT:
            branch[3 + 2 * j] = -p[SLIP] * power * log
        elif name == AMPLITUDE and amplitude > 0:
            branch[3 + 2 * j] = -side * p[SLIP] * (1 + p[EXPONENT]) * power / amplitude
        moved[j] = 1.0 if name == RELEASE else 0.0


@compiled(**OPTIONS)
def _next_branch(p, active, branch, worn, bent, state, rates, moved):
    """The branch from the turning point that was reached, and how its beginning moves; arrays as in
    :func:`_first_branch`."""
    depth = 0.5 * (branch[0] - state[0])
    log = math.log(depth) if depth > 0 else 0.0
    power = math.exp((1 + p[EXPONENT]) * log) if depth > 0 else 0.0
    slope = p[SLIP] * (1 + p[EXPONENT]) * power / depth if depth > 0 else 0.0
    way, length, lacking = branch[0] - state[0], p[PRESLIDING], p[DRY] - bent[0]
    yields = math.exp(-way / length) if length > 0 and way < BORNE * length else 0.0
    # Sensitivities first: they need A, h and b of the branch before.
    for j in range(active.size):
        # u' = 0 at the turn: it comes later by -(du'/dp) / u''; A itself does not change by that, being an extreme
        if rates[1] > 0:
            moved[j] -= state[3 + 2 * j] / rates[1]
        change = slope * (branch[2 + 2 * j] - state[2 + 2 * j])
        if active[j] == SLIP:
            change += 2 * power
        elif active[j] == EXPONENT:
            change += 2 * p[SLIP] * power * log
        branch[3 + 2 * j] = -branch[3 + 2 * j] - change
        further = branch[2 + 2 * j] - state[2 + 2 * j]
        worn[1 + j] += further
        # b changes its sign with the direction: -(x_k - (x_k - b) exp(-way / l))
        bent[1 + j] *= -yields
        if active[j] == DRY:
            bent[1 + j] -= 1 - yields
        if yields > 0:
            stretch = way / length if active[j] == PRESLIDING else 0.0
            bent[1 + j] -= lacking * yields * (further - stretch) / length
        branch[2 + 2 * j] = -state[2 + 2 * j]
    # u changes its sign with the direction, and so does h, less what this branch took
    branch[1] = -branch[1] - 2 * p[SLIP] * power
    worn[0] += way
    bent[0] = lacking * yields - p[DRY]
    branch[0] = -state[0]


@compiled(**OPTIONS)
def _step(p, active, sine, work):
    """One step towards the next turning point, or onto it: its length [s], and whether it is there."""
    branch, state, rates, end, end_rates = work[7], work[8], work[9], work[10], work[11]
    length = STEP / p[FREQUENCY]
    if p[SPEED] > 0:
        length = min(length, 0.3 * (p[SPEED] + 0.3 * abs(state[1])) / abs(rates[1]))
    way, presliding = branch[0] - state[0], p[PRESLIDING]
    if presliding > 0 and way < BORNE * presliding:
        presliding = max(presliding, FINEST * abs(p[AMPLITUDE]))
        # yielding: the contact's own oscillation, and its exponential; longer as less is lacking
        length = min(length, STEP / (p[FREQUENCY] * math.sqrt(1 + (p[DRY] - work[14, 0]) / presliding)))
        reach = YIELDING * (presliding + 0.3 * way)
        speed = abs(state[1])
        length = min(length, 2 * reach / (speed + math.sqrt(speed * speed + 2 * abs(rates[1]) * reach)))
    _advance(state, length, p, active, sine, branch, rates, work, end)
    _rates(end, p, active, sine, branch, work[13], work[14], end_rates)
    if end[1] < 0:
        return length, False
    share = state[1] / (state[1] - end[1])
    for _ in range(4):  # on the quintic
        slope = rates[1] + (end_rates[1] - rates[1]) * share
        change = _speed(share, length, state, rates, end, end_rates) / (length * slope) if slope > 0 else 0.0
        share = min(1.0, max(0.0, share - change))
    length *= share
    for _ in range(2):  # on the motion itself
        _advance(state, length, p, active, sine, branch, rates, work, end)
        _rates(end, p, active, sine, branch, work[13], work[14], end_rates)
        if end_rates[1] > 0:
            length -= end[1] / end_rates[1]
    _advance(state, length, p, active, sine, branch, rates, work, end)
    end[1] = 0.0
    _rates(end, p, active, sine, branch, work[13], work[14], end_rates)
    return length, True


@compiled(**OPTIONS)
def _read(sample, share, length, p, active, side, work, x, jacobian):
    """A sample at the share of a step."""
    state, rates, end, end_rates, moved = work[8], work[9], work[10], work[11], work[12]
    speed = _speed(share, length, state, rates, end, end_rates)
    x[sample] = p[REST] + side * _quintic(share, length, state, rates, end, end_rates, 0)
    for j in range(active.size):
        change = _quintic(share, length, state, rates, end, end_rates, 2 + 2 * j)
        jacobian[sample, j] = side * (change - speed * moved[j]) + (1.0 if active[j] == REST else 0.0)


@compiled(**OPTIONS)
def _leaves(p, sine, most, branch, bent, way):
    """Whether the mass leaves its turning point."""
    pull = _turning_spring(branch, p, sine)
    if p[PRESLIDING] > 0:  # a contact that yields holds nothing
        return pull - bent > LEAST * abs(p[AMPLITUDE])
    level = 1 + p[WEAR] * way / abs(p[AMPLITUDE]) if p[WEAR] != 0 else 1.0
    if most < 0 and (abs(pull) <= p[DRY] * (1 + p[RISE]) * level or branch[0] < LEAST * abs(p[AMPLITUDE])):
        return False
    return pull >= 0 and branch[0] > 0


@compiled(**OPTIONS)
def decay(times, p, active, sine, most, work, x, jacobian):
    """Fill `x` (n,) and `jacobian` (n, active.size) at rising `times`; return the number of half cycles begun.

    `most` half cycles at the most, -1 for as many as the dry friction lets it make; `work` is (15, 2 + 2 active), `p`
    (WIDTH,), times in s.
    """
    count, size = times.size, 2 + 2 * active.size
    branch, state, rates, end, end_rates, moved = work[7], work[8], work[9], work[10], work[11], work[12]
    worn, bent = work[13], work[14]
    side = 1.0 if p[AMPLITUDE] >= 0 else -1.0
    start, sample, half_cycles = p[RELEASE], 0, 0
    _first_branch(p, active, side, branch, worn, bent, moved)
    # Hold: until the release.
    while sample < count and times[sample] <= start:
        _rest(sample, p, active, side, branch, x, jacobian)
        sample += 1
    # Half cycle: from a turning point that the mass leaves, step by step onto the next.
    while sample < count and half_cycles != most and _leaves(p, sine, most, branch, bent[0], worn[0]):
        half_cycles += 1
        for i in range(size):
            state[i] = branch[i] if i % 2 == 0 else 0.0
        _rates(state, p, active, sine, branch, worn, bent, rates)
        if rates[1] >= 0:
            break
        turned = False
        while sample < count and not turned:
            length, turned = _step(p, active, sine, work)
            # samples of the step, on its quintic
            while sample < count and times[sample] <= start + length:
                _read(sample, (times[sample] - start) / length, length, p, active, side, work, x, jacobian)
                sample += 1
            start += length
            for i in range(size):
                state[i], rates[i] = end[i], end_rates[i]
        if not turned:
            break
        side = -side
        _next_branch(p, active, branch, worn, bent, state, rates, moved)
    while sample < count:  # at rest
        _rest(sample, p, active, side, branch, x, jacobian)
        sample += 1
    return half_cycles
