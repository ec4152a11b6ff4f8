"""Calibration: positions of the micro-images, from a white image.

- `lattice_fit`: `calibrate`, from what is given to a `Calibration`
- `whole`: the lattice of one picture: period, spots, robust fit
- `tiles`: the same for large pictures, by their middle and tiles
- `unlit`: which lenslets are dark or saturated
- `period`: the lattice vectors, by autocorrelation, before any spot is known
- `vectors`, `multiples`: a candidate, and which of them hold several cells of the true lattice
- `centres`: sub-pixel centre of every micro-image
- `diagnosis`: `diagnose`, what a white image says about how a camera is put together
- `aligned`: a maker's lattice moved to the borders of micro-images on a raw image
- `following`: `followed`, the lattice near a known one that a picture repeats on
- `exact`: `exactly`, the lattice of a rectified picture, whose pitch is known
- `devignette`: divide a raw image by its white image; grey versions of colour images
"""

from lumigraph.calibration.borders import aligned
from lumigraph.calibration.devignette import devignette
from lumigraph.calibration.diagnosis import diagnose
from lumigraph.calibration.exact import exactly
from lumigraph.calibration.following import followed
from lumigraph.calibration.lattice_fit import calibrate

__all__ = ["aligned", "calibrate", "devignette", "diagnose", "exactly", "followed"]


def __dir__() -> list[str]:
    return __all__
