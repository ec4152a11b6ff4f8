"""Experiments: printed, correct and computed values of the thesis, side by side.

- `registry`: `ResultRow`, `ExperimentOutcome`, `Context`, the decorator `experiment`
- `methods`: three propagation methods of the thesis, which importing this package adds to `METHODS`
- `collected`: all `experiments`, and `find`
- `run`: runs experiments, resumes what was interrupted
- `pages`: the report of a run
- `figures`: one table or figure, one file, one function
- `microscope`: what a light-field microscope resolves
- `beyond`: what the thesis does not have, such as deconvolution
"""

from lumigraph.studies.thesis import methods as _methods  # noqa: F401 (registers itself)
from lumigraph.studies.thesis.collected import experiments, find
from lumigraph.studies.thesis.registry import Context, Experiment, ExperimentOutcome, ResultRow, experiment

__all__ = ["Context", "Experiment", "ExperimentOutcome", "ResultRow", "experiment", "experiments", "find"]


def __dir__() -> list[str]:
    return __all__
