"""What several logs of one joint tell together, and how far each is predicted by the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.cycle.joint import RICHER, Telling, delay_of, misfits, punctual
from stickslip.cycle.joint_fall import bends
from stickslip.cycle.joint_fit import JointData, about_load, fitted, joint_data, pooled, seating, turning, warmed
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import Constant, Estimate, Result
from stickslip.record.record import Record


@dataclass(frozen=True, eq=False)
class JointPrediction:
    """How far the torque of a log is predicted by what the other logs tell.

    Attributes
    ----------
    error, plain : float
        Norm of what the prediction misses over that of the torque about its mean, by all that the other logs tell; and
        by Coulomb and viscous friction alone, fitted to the same logs with inertia and gravity.
    time : ndarray, shape (m,)
        Times [s] at which the joint slides.
    measured, predicted : ndarray, shape (m,)
        As it was, smoothed by windows within strokes, and as it is predicted [N m].
    """

    error: float
    plain: float
    time: Array
    measured: Array
    predicted: Array


@dataclass(frozen=True, eq=False, repr=False)
class JointLogs(Result):
    """What several logs of one joint tell together.

    Attributes
    ----------
    forward, back, viscous, load, inertia, sine, cosine, damping, warming, thinning : Estimate or None
        As of :class:`JointFriction`, of all logs at once; None where they do not tell it, or where it was stated.
    predictions : tuple of JointPrediction
        Of each log by the others.
    left_out : tuple of str
        What all logs together can not tell, and which motion would.
    status : str
        "ok", or in words what to beware of.
    delay : Estimate or None
        As of :class:`JointFriction`, of all logs at once.
    """

    forward: Estimate
    back: Estimate
    viscous: Estimate
    load: Estimate | None
    inertia: Estimate | None
    sine: Estimate | None
    cosine: Estimate | None
    damping: Estimate | None
    warming: Estimate | None
    thinning: Estimate | None
    predictions: tuple[JointPrediction, ...]
    left_out: tuple[str, ...]
    status: str = "ok"
    delay: Estimate | None = None


def regress_joint_logs(
    records: Sequence[Record], *, gravity: bool | None = None, **constants: Constant | None
) -> JointLogs:
    r"""What do several logs of one joint tell together, and does what some tell hold in the others?

    The balance of :func:`regress_joint` is solved for all logs at once, so that one may tell gravity and another
    viscous friction. Each log is then left out in turn: the others' solution predicts its torque :math:`\tau` from its
    motion, and told is

    .. math:: \frac{|\tau - \hat\tau|}{|\tau - \bar\tau|},

    the normalised root of the mean square (Ljung, System Identification, 1999, section 16.4), while the joint slides;
    beside it stands that of Coulomb and viscous friction, fitted to the same logs.

    Parameters
    ----------
    records : sequence of Record
        Two or more, each as :func:`regress_joint` takes it, all with a torque of the same source.
    gravity : bool, optional
        As of :func:`regress_joint`.
    **constants : float, str, tuple or Estimate
        `inertia`, `kp`, `kd`, `torque_constant` and `play`, as of :func:`regress_joint`.

    Returns
    -------
    JointLogs

    Raises
    ------
    RecordError
        Fewer than two logs, or logs whose torques have different sources.
    ModelError
        A constant without meaning.
    EstimateError
        What a log, or all but one, can not tell: the sentence says which motion would.

    Examples
    --------
    >>> def moved(seed, speed):
    ...     t = np.arange(4000) / 200
    ...     q = np.sin(2 * np.pi * speed * t) + 0.4 * np.sin(2 * np.pi * 3.1 * speed * t)
    ...     v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    ...     torque = 0.02 * a + 0.03 * v + (0.06 + 0.1 * abs(0.5 * np.sin(q))) * np.sign(v) + 0.5 * np.sin(q)
    ...     torque += np.random.default_rng(seed).normal(0, 0.01, t.size)
    ...     return Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"})
    >>> together = regress_joint_logs([moved(0, 0.2), moved(1, 0.3), moved(2, 0.5)])
    >>> together.load.includes(0.1)
    True
    >>> [bool(one.error < one.plain) for one in together.predictions]
    [True, True, True]
    """
    teeth = [seating(record, gravity, **constants) for record in records]
    data, slow = (
        warmed(
            [joint_data(record, gravity, slowly, at, **constants)[1] for record, at in zip(records, teeth, strict=True)]
        )
        for slowly in (False, True)
    )
    if len(data) < 2 or len({(one.source, one.terms) for one in data}) > 1:
        raise RecordError(
            f"{len(data)} log{'s' * (len(data) != 1)}, with torque by {', '.join(one.source for one in data)}",
            "several logs are told together by torques of one source",
            "give two logs or more, of one robot and one kind",
        )
    delay = delay_of(pooled(data))
    data, slow = [punctual(one, delay) for one in data], [punctual(one, delay) for one in slow]
    fit, terms, pull, left_out = fitted(pooled(data))
    beside = misfits(pooled(data), fit, bends(pooled(slow), fit, terms, pull), turning(records[0]))
    tell = Telling(pooled(data), fit, terms, turning(records[0]), "ok", beside)
    known = {term: tell.one(term) for term in terms if term != "uneven"}
    predictions = [
        _predicted(log, pooled(data[:place] + data[place + 1 :]), record)
        for place, (log, record) in enumerate(zip(data, records, strict=True))
    ]
    return JointLogs(
        *tell.ways(),
        known["viscous"],
        load=known.get("load"),
        inertia=known.get("inertia"),
        sine=known.get("sine"),
        cosine=known.get("cosine"),
        damping=known.get("damping"),
        warming=known.get("warming"),
        thinning=known.get("thinning"),
        predictions=tuple(predictions),
        left_out=left_out,
        delay=delay,
    )


def _predicted(log: JointData, others: JointData, record: Record) -> JointPrediction:
    """A log's torque by the regression of the others, and by a plain one."""
    fit, terms, pull, _ = fitted(others)
    predicted = log.model(fit, terms, pull)
    plain = tuple("coulomb" if term == "forward" else term for term in terms if term not in {*RICHER, "back"})
    fit, pull = about_load(replace(others, terms=plain), plain)
    spread = float(np.linalg.norm(log.torque - log.torque.mean()))
    if spread == 0:
        raise EstimateError("the torque of a log never changes", "a prediction is of a torque", "check its column")
    error, simple = (
        float(np.linalg.norm(log.torque - torque)) / spread for torque in (predicted, log.model(fit, plain, pull))
    )
    time = record.start + log.logs[0].sliding.rows / record.fs
    return JointPrediction(error, simple, time, log.torque, predicted)
