r"""Several raw images of one object as one row of pixels, weighted by their noise.

Each is brought to electrons, in which photon noise is Poisson's whatever the gain: with the gain g and the
light t of each raw image k, and the first one's gain :math:`g_0`,

.. math:: g_k (r_k - r_{0k}) + \sigma_k^2 \sim
          \mathrm{Poisson}(g_0 t_k v_k \cdot A_k o + g_k (b_k - r_{0k}) + \sigma_k^2)

so that likelihoods add up, and a raw image counts by its electrons.
"""

import warnings
from collections.abc import Sequence
from dataclasses import replace

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.joint import Joint
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.deconvolution.problem import Problem, pixels, values
from lumigraph.errors import CalibrationError, GeometryError, SamplingWarning

OFF = 0.05
"""Part by which a raw image may be brighter or darker than the object found sends, without a warning."""

CERTAIN = 6.0
"""Standard deviations of the photon noise by which it must be off, too."""

_SCALE = "electrons_per_intensity"

Raws = Sequence[RawImage | Array]


def joined(operator: Linear | Sequence[Linear]) -> Linear:
    """An operator, or several of one object as one."""
    if not isinstance(operator, list | tuple):
        return operator  # type: ignore[return-value]
    for number, one in enumerate(operator):
        if not isinstance(one, Linear):
            raise GeometryError(
                f"operator {number} is of type {type(one).__name__} but must be a Linear. "
                "Give camera.operator()."
            )
    return (
        Joint(tuple(operator), object_grid=operator[0].object_grid, depths=operator[0].depths)
        if operator
        else Joint(())
    )


def check_count(raws: object, operator: Joint) -> Raws:
    """The raw images, one for each of the operators.

    Raises
    ------
    CalibrationError
        A single one, or another number of them.
    """
    if not isinstance(raws, list | tuple):
        raise CalibrationError(
            f"the operator makes {len(operator.maps)} raw images but one {type(raws).__name__} is given. "
            "Give a list of them."
        )
    if len(raws) != len(operator.maps):
        raise CalibrationError(
            f"there are {len(raws)} raw images but {len(operator.maps)} operators. Give one for each."
        )
    return raws


def exposures_of(raws: Raws, given: Exposure | Sequence[Exposure] | None) -> tuple[Exposure, ...]:
    """Exposure of each raw image: as given, one for all or one for each, or as recorded.

    Raises
    ------
    CalibrationError
        Another number of exposures than of raw images, or the gains of some but not of all.
    """
    if isinstance(given, Exposure):
        return (given,) * len(raws)
    if given is None:
        return _recorded(raws)
    if not isinstance(given, list | tuple) or len(given) != len(raws):
        raise CalibrationError(f"exposure must be one Exposure, or {len(raws)} of them: one for each.")
    for one in given:
        if not isinstance(one, Exposure):
            raise CalibrationError(f"an exposure is of type {type(one).__name__} but must be an Exposure.")
    return tuple(given)


def _recorded(raws: Raws) -> tuple[Exposure, ...]:
    """Noise of each, and their light where all of them record it."""
    known = [Exposure.of(raw) if isinstance(raw, RawImage) else Exposure() for raw in raws]
    found = [raw.metadata.get(_SCALE) if isinstance(raw, RawImage) else None for raw in raws]
    scales = [float(scale) for scale in found if scale is not None]
    if len(scales) < len(raws):
        return tuple(known)
    return tuple(replace(one, light=scale / scales[0]) for one, scale in zip(known, scales, strict=True))


def together(raws: Raws, operator: Joint, exposures: Sequence[Exposure]) -> tuple[Array, Exposure]:
    """Pixels of all raw images (n,) in electrons, or in their values, and the exposure of that row.

    Raises
    ------
    CalibrationError
        The gains of some raw images but not of all; raw images that are none, or of other shapes.
    """
    gains = [one.gain for one in exposures]
    unknown = [k for k, gain in enumerate(gains) if gain is None]
    if 0 < len(unknown) < len(gains):
        raise CalibrationError(
            f"the gain of raw image {unknown[0]} is not known but that of others is: their weights "
            "are undetermined. Give Exposure(gain=...), electrons per value, for each, or for none."
        )
    first, rows = gains[0] or 1.0, []
    for raw, one, exposure in zip(raws, operator.maps, exposures, strict=True):
        data = values(raw, one, exposure)
        rows.append(_row(data, exposure, first))
    xp = arrays.namespace(rows[0][0])
    data, response, background, weights = (xp.concat(column) for column in zip(*rows, strict=True))
    known = all(one.weights is None for one in exposures)
    gain = None if unknown else 1.0
    return data, Exposure(background, response, None if known else weights, gain)


def _row(data: Array, exposure: Exposure, first: float) -> tuple[Array, Array, Array, Array]:
    """Data, response, background and weights (n,) of one raw image."""
    xp, shape = arrays.namespace(data), tuple(data.shape)
    gain, zeros = exposure.gain or 1.0, xp.zeros_like(data)
    response = pixels("response", exposure.response, shape, data)
    weights = pixels("weights", exposure.weights, shape, data)
    level = exposure.background
    if getattr(level, "shape", ()):
        level = pixels("background", level, shape, data)
    background = gain * (zeros + level + exposure.offset)
    background = xp.where(background > 0, background, zeros)
    light = first * exposure.light * (zeros + 1 if response is None else response)
    counted = zeros + 1 if weights is None else weights
    planes = gain * (data + exposure.offset), light, background, counted
    return tuple(xp.reshape(plane, (-1,)) for plane in planes)  # type: ignore[return-value]


def warn_of_brightness(problem: Problem, model: Array, operator: Joint) -> None:
    """Warn where raw images are brighter or darker than the object found sends: their light is another.

    Warns
    -----
    SamplingWarning
        One of them is, by more than `OFF`, and more than the noise explains.
    """
    xp, scale = arrays.namespace(model), problem.scale
    counted = xp.ones_like(model) if scale.weights is None else scale.weights
    planes = (problem.data, model, 0 * model + scale.background)
    rows = [[float(xp.sum(part)) for part in operator.parted(counted * plane)] for plane in planes]
    ratios = [(seen - dark) / max(sent - dark, problem.floor) for seen, sent, dark in zip(*rows, strict=True)]
    off = [
        abs(ratio - 1) > OFF and abs(seen - sent) > CERTAIN * max(sent, 0.0) ** 0.5
        for ratio, seen, sent in zip(ratios, *rows[:2], strict=True)
    ]
    if any(off):
        told = ", ".join(f"{ratio:.3g}" for ratio in ratios)
        warnings.warn(
            f"the raw images are {told} times as bright as the object that explains all of them "
            "sends. Give the light of each, Exposure(light=...), or check backgrounds and operators.",
            SamplingWarning,
            stacklevel=3,
        )
