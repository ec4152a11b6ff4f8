"""Experiments: printed, correct and computed values of the thesis, side by side.

- `registry`: `Row`, `Outcome`, `Context`, the decorator `experiment`
- `collected`: all `experiments`, and `find`
- `run`: runs experiments, resumes what was interrupted
- `pages`: the report of a run
- `thesis`: one table or figure, one file, one function
- `microscope`: what a light-field microscope resolves
- `beyond`: what the thesis does not have, such as deconvolution
"""

from lumigraph.experiments.collected import experiments, find
from lumigraph.experiments.registry import Context, Experiment, Outcome, Row, experiment

__all__ = ["Context", "Experiment", "Outcome", "Row", "experiment", "experiments", "find"]
