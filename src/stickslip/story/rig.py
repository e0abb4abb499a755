"""What the virtual rig gives, in a folder: a record with its truth, or the plan of an experiment."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from stickslip.answers.experiment import ExperimentPlan
from stickslip.errors import ModelError
from stickslip.files.write import WRITERS, write_record
from stickslip.plot.experiment import plot_plan
from stickslip.plot.plate import plate
from stickslip.record.record import Record
from stickslip.story.folder import results_folder, write_figures


def publish_rig(results: Record | ExperimentPlan, *, folder: str | Path, form: str = "csv") -> Path:
    """Write a virtual record, or the plan of an experiment, into a folder.

    Of a record: the file, and ``results.json`` with the truth and what is wrong with the record. Of a plan:
    ``results.json`` with every setup and its accuracy, and the figure. The folder appears when all is written. An
    earlier one of ours is replaced; a folder that holds anything else is left alone.

    Parameters
    ----------
    results : Record or ExperimentPlan
        From :meth:`Rig.measure`, or from :func:`plan_experiment`.
    folder : path
        The folder to make.
    form : {"csv", "h5", "parquet"}
        Format of the record.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        A format is not known, or the folder holds something that is not ours.
    RecordError
        The folder can not be written.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1, stiffness=100, law=ss.laws.Coulomb(0.2))
    >>> run = ss.simulate(slider, start={"x": 0.05}, duration=2.0)
    >>> folder = publish_rig(ss.Rig().measure(run, fs=500, rng=1), folder=Path(tempfile.mkdtemp()) / "rig")
    >>> sorted(path.name for path in folder.iterdir())
    ['record.csv', 'results.json']
    """
    if f".{form}" not in WRITERS:
        raise ModelError(f"a record as '{form}'", f"it is written as {', '.join(w[1:] for w in WRITERS)}", "choose one")
    if isinstance(results, Record):
        told = {"fs": results.fs, "truth": dict(results.truth), "faults": [str(fault) for fault in results.check()]}
        with results_folder(Path(folder), told) as draft:
            write_record(results, draft / f"record.{form}")
        return Path(folder)
    with results_folder(Path(folder), results.to_dict()) as draft:
        caption = "Root-mean-square error against the sampling rate, for each choice of sensors."
        plan = plate("plan", partial(plot_plan, results), "What each setup tells", caption)
        write_figures(draft / "figures", "", [plan])
    return Path(folder)
