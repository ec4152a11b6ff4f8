"""Optical elements that light passes between planes: functions from `Field` to `Field`.

- `train`: `Element`, the protocol, and `Train`, elements one after the other
- `transmission`: what thin elements share: a cached factor for each sample
- `apertures`: `CircularAperture`, `RectangularAperture`
- `lens`: `ThinLens`
- `lenslets`: `LensletArray`, square or hexagonal, of one or three focal lengths
- `scatter`: `Scatter`, how lenslets of an array differ from each other; `form`, terms of their form
- `surface`: `GlassSurface`, the curved side of lenslets of glass
- `lean`: `TiltAndBow`, tilt and bow of arrays and sensors
- `zernike`: Zernike polynomials in Noll's order and `ZernikePlate`
- `pupil_mask`: `PupilMask`, phase masks, coded apertures and diffusers in the stop
- `field_plate`: Zernike terms that change over the field, and their plate
- `objective`: `Objective`, a microscope's, for points before it; `disc`, nodes of its pupil
- `masks`: white random phases and the thesis' random phase mask
"""

from lumigraph.elements.apertures import CircularAperture, RectangularAperture
from lumigraph.elements.lens import ThinLens
from lumigraph.elements.lenslets import LensletArray
from lumigraph.elements.masks import random_phase_mask, white_phase
from lumigraph.elements.object_space import ObjectSpace
from lumigraph.elements.pupil_mask import PupilMask
from lumigraph.elements.train import Element, Train
from lumigraph.elements.zernike import ZernikePlate, noll_to_nm, zernike

__all__ = [
    "CircularAperture",
    "Element",
    "LensletArray",
    "ObjectSpace",
    "PupilMask",
    "RectangularAperture",
    "ThinLens",
    "Train",
    "ZernikePlate",
    "noll_to_nm",
    "random_phase_mask",
    "white_phase",
    "zernike",
]


def __dir__() -> list[str]:
    return __all__
