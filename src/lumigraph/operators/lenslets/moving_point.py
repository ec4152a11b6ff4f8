"""Image of a point and its derivatives by the point's place, as one function of a camera's numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint


def moving_numbers(own: SampledCamera, source: SourcePoint) -> dict[str, np.ndarray]:
    """Numbers that a point's light, and its change as the point moves, follow from."""
    return own.numbers(source) | own.move_numbers(source)


def moving_intensity(
    own: SampledCamera, xp: ArrayLibrary, numbers: Numbers, prepared: Numbers, source: SourcePoint, lit: Any
) -> Array:
    """Intensity of a point of 1 and its derivatives by y, x and dz (4, y, x) [1/m], of a camera's numbers."""
    down, across = numbers["move y"], numbers["move x"]
    phases = [down[k][:, None] + across[k] for k in range(3)]
    return changed_intensity(own, xp, numbers, prepared, source, lit, phases)


def changed_intensity(
    own: SampledCamera,
    xp: ArrayLibrary,
    numbers: Numbers,
    prepared: Numbers,
    source: SourcePoint,
    lit: Any,
    phases: Sequence[Array],
) -> Array:
    """Intensity of a point of 1 and its derivatives (n + 1, y, x) by phases in the main lens."""
    wave = main_lens.wave(xp, numbers)
    waves = xp.stack([wave, *(1j * phase * wave for phase in phases)])
    fields = own.field(xp, {**numbers, "wave": waves}, prepared, source, lit)
    return intensities(xp, fields[0], [fields[k + 1] for k in range(len(phases))])


def own_changes(
    own: SampledCamera, source: SourcePoint, phases: Sequence[np.ndarray] | None = None
) -> np.ndarray:
    """The same in plain numbers; by the point's place where no phases are given."""
    lit, prepared = own.lit(source), own.lenslets.prepared(own.keys(source))
    if phases is None:
        return moving_intensity(own, NUMPY, moving_numbers(own, source), prepared, source, lit)
    return changed_intensity(own, NUMPY, own.numbers(source), prepared, source, lit, phases)


def intensities(xp: ArrayLibrary, still: Array, moves: Sequence[Array]) -> Array:
    """Intensity of a field, and its change with the field's (n + 1, y, x)."""
    real, imag = xp.real(still), xp.imag(still)
    changes = [2 * (real * xp.real(move) + imag * xp.imag(move)) for move in moves]
    return xp.stack([real**2 + imag**2, *changes])
