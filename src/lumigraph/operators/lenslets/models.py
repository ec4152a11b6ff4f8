"""Choice of an array's lenslets: alike or each its own, square or of any shape, paraxial or exact."""

from typing import Any

import numpy as np

from lumigraph.operators.lenslets.any_shape import AnyShape
from lumigraph.operators.lenslets.exact_square import ExactSquareLenslets
from lumigraph.operators.lenslets.individual import IndividualLenslets, require_square
from lumigraph.operators.lenslets.square import SquareLenslets
from lumigraph.operators.sampling.optics import Optics


def lenslets_of(optics: Optics, precision: type[np.complexfloating] = np.complex64, like: Any = None) -> Any:
    """Light in the lenslet plane to light on the image, in the frame that turns with the lenslets."""
    if optics.array.scatter is not None:
        require_square(optics.array, optics.camera.model)
        return IndividualLenslets(optics, precision, like)
    if optics.camera.model == "exact":
        return ExactSquareLenslets(optics, precision, like)
    return (SquareLenslets if optics.straight else AnyShape)(optics, precision, like)
