"""One way in for a raw image: ready for every verb, the viewer and Python.

- `prepare`: `prepare`, a raw image and what is known of it as one `PreparedImage`; `of_raw`, functions of
  raw images that prepare what comes unprepared
- `validity`: which pixels and lenslets count, and why the others do not
- `drift`: the lattice that a raw image carries itself, beside that of a calibration
- `agreement`: what a picture says about the camera that its file describes
- `vignetting`: how much light reaches each micro-image
- `beside`: the pictures that come with a raw image
- `given`, `calibration_file`: the files that come with a raw image
"""

from lumigraph.core.prepared import PreparedImage, Reason
from lumigraph.preparation.calibration_file import read_calibration
from lumigraph.preparation.drift import drift
from lumigraph.preparation.given import sharp_kinds
from lumigraph.preparation.prepare import decode, prepare, render, render_stack, super_resolve
from lumigraph.preparation.vignetting import vignetting

__all__ = [
    "PreparedImage",
    "Reason",
    "decode",
    "drift",
    "prepare",
    "read_calibration",
    "render",
    "render_stack",
    "sharp_kinds",
    "super_resolve",
    "vignetting",
]


def __dir__() -> list[str]:
    return __all__
