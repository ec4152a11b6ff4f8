"""Demonstration: a still life, a focused plenoptic camera and a microscope.

- `showcase`: `run`, which simulates, calibrates, renders, refocuses, measures depth and writes a report
- `helix`: a microscope's exposure of a double helix, and the volume found in it
"""

from lumigraph.demo.showcase import run

__all__ = ["run"]


def __dir__() -> list[str]:
    return __all__
