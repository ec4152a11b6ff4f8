"""One verb for free space: `propagate`, its methods, and the choice among them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, ParaxialWarning, SamplingError
from lumigraph.propagation import plausible, sampling
from lumigraph.propagation.angular_spectrum import angular_spectrum, band_limited, band_limited_intensity
from lumigraph.propagation.dropped import FEWEST_FREQUENCIES
from lumigraph.propagation.fresnel import fresnel
from lumigraph.propagation.window import samples_between
from lumigraph.propagation.zoom import zoom

Method = Callable[[Field, Any, float, Grid | None], Field]

_METHODS: dict[str, Method] = {
    "fresnel": fresnel,
    "angular_spectrum": angular_spectrum,
    "band_limited": band_limited,
    "zoom": zoom,
}
_PARAXIAL = {"fresnel"}
_DIFFERENTIABLE = {"angular_spectrum", "band_limited"}

METHODS: Mapping[str, Method] = MappingProxyType(_METHODS)
"""Every method by name; `"auto"` stands for the one that `choose_method` picks. See `register`."""

_OF_THE_THESIS = ("multi_step_fresnel", "band_limited_circular", "corrected_band_limited")

SHORTEST = 1e-100
"""Distances nearer to zero count as zero [m]."""
LARGEST_PHASE_ERROR = 1e-3
"""Phase [rad] that "auto" lets the Fresnel approximation leave out."""
MOST_POINTS = 1000
"""Samples per axis up to which one pair of matrix products is quicker than `zoom`'s two."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A method, its padding, and why."""

    method: str
    pad: float
    reason: str


@dataclass(frozen=True, slots=True)
class Propagate:
    """Free space as an element of a train: see `propagate`.

    Examples
    --------
    >>> import numpy as np
    >>> grid = Grid.square(64, 10e-6)
    >>> beam = Field(np.exp(-(grid.y[:, None]**2 + grid.x**2) / 1e-8).astype(complex), grid, 633e-9)
    >>> Propagate(1e-3)(beam).grid == grid
    True
    """

    distance: float | Array
    method: str = "band_limited"
    pad: float = 1.0
    grid: Grid | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "distance", checks.parameter("distance", self.distance))
        _check_method(self.method)
        _check_pad(self.pad)

    def __call__(self, field: Field) -> Field:
        """The field after the distance."""
        return propagate(field, self.distance, self.method, self.pad, grid=self.grid)

    def intensity(self, field: Field) -> Array:
        """Intensity (..., y, x) after the distance: the same as of the field, quicker where band-limited."""
        if self.method != "band_limited" or abs(arrays.number(self.distance)) < SHORTEST:
            return self(field).intensity
        checks.instance("field", field, Field)
        intensity = band_limited_intensity(field, self.distance, self.pad, self.grid)
        sampling.warn(plausible.undersampled(field))
        if self.grid is None:
            xp, area = arrays.namespace(intensity), math.prod(field.grid.pitch)
            power = xp.sum(intensity, axis=(-2, -1)) * area
            sampling.warn(plausible.light_left(field, power, arrays.number(self.distance)))
        return intensity


def register(name: str, method: Method, *, paraxial: bool = False, differentiable: bool = False) -> None:
    """Add a method to `METHODS`.

    Parameters
    ----------
    name
        As `propagate` takes it.
    method
        Takes a field, a distance [m], a padding and an output grid or None, and returns the field there.
    paraxial
        It makes the Fresnel approximation: `propagate` warns where that is too coarse.
    differentiable
        It takes a distance that is a 0-d array of an automatic-differentiation library.

    Raises
    ------
    SamplingError
        A method of another module has that name.
    """
    known = _METHODS.get(name)
    if name == "auto" or (known is not None and known.__module__ != method.__module__):
        raise SamplingError(f"there is already a propagation method {name!r}. Choose another name.")
    _METHODS[name] = method
    for group, belongs in ((_PARAXIAL, paraxial), (_DIFFERENTIABLE, differentiable)):
        if belongs:
            group.add(name)


def propagate(
    field: Field,
    distance: float | Array,
    method: str = "band_limited",
    pad: float = 1.0,
    *,
    grid: Grid | None = None,
) -> Field:
    r"""The field after `distance` of free space, a new `Field`.

    .. math:: U(x, y; z) = \mathcal{F}^{-1}\{\mathcal{F}\{U(x, y; 0)\}\, H(f_x, f_y; z)\}

    Parameters
    ----------
    field
        Amplitude (..., y, x); leading axes are a batch. NumPy, PyTorch or another array API library.
    distance
        z [m]; negative goes back. Zero returns the field on `grid`. A 0-d array such as a PyTorch scalar is
        differentiated through, by the spectral methods and by "fresnel" onto a given grid.
    method
        One of `METHODS`, or "auto". "fresnel" has its own output pitch λ|z|/(N p) unless `grid` is
        given, "zoom" needs `grid`, the others keep the pitch.
    pad
        Zeros added to the window, as a fraction of the input window: 1 doubles it and keeps wrapped
        light off the output; 0 is the unpadded window of the thesis. "fresnel" and "zoom" have no use
        for it, "auto" chooses it.
    grid
        Output grid; the input's own if left out. Methods that keep the pitch take any window whose
        samples fall on the input's, smaller, larger or shifted, or every second, third … of those samples,
        and compute little more than these.

    Returns
    -------
    Field
        On `grid`, in the library and precision of `field.data`.

    Raises
    ------
    SamplingError
        An unknown method, one that cannot be differentiated by the distance, "zoom" without a grid, "fresnel"
        over zero distance, a window that needs
        more memory than there is, or an output too far off.
    GeometryError
        A distance or pad that is not a finite number, or an output grid that a method cannot reach.

    Warns
    -----
    SamplingWarning
        The result is defined but aliases, light wraps round, or the band limit drops light that belongs to
        the output; without `grid`, more than 1 % of the light left the window; a smooth wave turns too fast
        for its samples. The message gives the numbers.
    ParaxialWarning
        The Fresnel approximation makes more than 1 % rms of the field wrong.

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, sections 3.10 and 4.2; Matsushima and Shimobaba,
    Opt. Express 17, 19662 (2009).

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.units import um, mm, nm
    >>> grid = Grid.square(200, 10*um)
    >>> beam = Field(np.exp(-(grid.y[:, None]**2 + grid.x**2) / (0.2*mm)**2), grid, 633*nm)
    >>> round(float(propagate(beam, 100*mm).power / beam.power), 6)
    1.0
    """
    checks.instance("field", field, Field)
    if grid is not None:
        checks.instance("grid", grid, Grid)
    way = checks.parameter("distance", distance)
    distance = arrays.number(way)
    _check_method(method)
    _check_pad(pad)
    if abs(distance) < SHORTEST:  # dividing by it would overflow
        distance = 0.0
    given = grid
    if method == "auto":
        choice = choose_method(field.grid, distance, field.wavelength, grid)
        method, pad, grid = choice.method, choice.pad, grid or field.grid
    if distance == 0 and method not in ("fresnel", "zoom") and not arrays.is_parameter(way):
        return _on_window(field, grid or field.grid)
    if arrays.is_parameter(way):
        found = _differentiable(field, way, method, pad, grid)
    else:
        found = METHODS[method](field, distance, pad, grid)
    _check(method, field, distance, (given, found))
    return found


def _check(method: str, field: Field, distance: float, onto: tuple[Grid | None, Field]) -> None:
    """Warn of what speaks against a result, on the grid that was asked for."""
    given, found = onto
    if method in _PARAXIAL:
        reached = given if method == "fresnel" else found.grid
        sampling.warn(plausible.beyond_paraxial(method, field, distance, reached), ParaxialWarning)
    if method == "fresnel":
        return
    sampling.warn(plausible.undersampled(field))
    if given is None:
        sampling.warn(plausible.light_left(field, found.power, distance))


def _differentiable(field: Field, distance: Array, method: str, pad: float, grid: Grid | None) -> Field:
    """Through a distance that is a 0-d array, where the method can."""
    if method not in _DIFFERENTIABLE and (method != "fresnel" or grid is None):
        raise SamplingError(
            f"method {method!r} cannot be differentiated by its distance. Use one of "
            f"{', '.join(sorted(_DIFFERENTIABLE))}, or 'fresnel' onto a grid."
        )
    if arrays.number(distance) == 0:
        raise SamplingError("a distance of 0 m cannot be differentiated. Give one above 0, or a plain 0.")
    return METHODS[method](field, distance, pad, grid)


def choose_method(grid: Grid, distance: float, wavelength: float, output: Grid | None = None) -> Choice:
    """Method and padding for a propagation, with the reason in one sentence.

    Parameters
    ----------
    grid
        Where the input stands.
    distance
        z [m].
    wavelength
        In vacuum [m].
    output
        Where the output is wanted; None for the input's grid.

    Examples
    --------
    >>> print(choose_method(Grid.square(1000, 5e-6), 0.316, 633e-9).reason)
    light spreads 20 mm, the window of 5 mm is doubled and 500 of 2000 frequencies per axis pass unaliased
    """
    checks.instance("grid", grid, Grid)
    if output is not None:
        checks.instance("output", output, Grid)
    distance, wavelength = checks.finite("distance", distance), checks.positive("wavelength", wavelength)
    target = output or grid
    if not _aligned(grid, target):
        return _onto_other(grid, target, distance, wavelength)
    if distance == 0:
        return Choice("band_limited", 0.0, "the distance is 0 m: the field is only cropped or padded")
    spread = abs(distance) * math.tan(math.asin(min(wavelength * 0.5 / min(grid.pitch), 0.999)))
    widths = [f"{1e3 * value:.3g} mm" for value in (spread, min(grid.size))]
    pad = min(1.0, 2 * spread / min(grid.size))
    padded = Grid((grid.shape[0] * 2, grid.shape[1] * 2), grid.pitch)
    if pad < 1:
        reason = (
            f"light spreads {widths[0]}, less than half of the window of {widths[1]}: padded by {pad:.2g}"
        )
        return Choice("band_limited", pad, reason)
    limits = sampling.band_limits(padded, distance, wavelength)
    passing = [
        min(n, round(2 * limit * size))
        for n, limit, size in zip(padded.shape, limits, padded.size, strict=True)
    ]
    if min(passing) < FEWEST_FREQUENCIES:
        reason = (
            f"only {min(passing)} frequencies of a doubled window of {2e3 * min(grid.size):.3g} mm pass "
            f"unaliased over {abs(distance):.4g} m, fewer than {FEWEST_FREQUENCIES}: "
            "a matrix DFT takes them as close as needed"
        )
        return Choice("zoom", 0.0, reason)
    reason = (
        f"light spreads {widths[0]}, the window of {widths[1]} is doubled and {min(passing)} of "
        f"{min(padded.shape)} frequencies per axis pass unaliased"
    )
    return Choice("band_limited", 1.0, reason)


def _aligned(grid: Grid, output: Grid) -> bool:
    try:
        output.samples_to(grid)
    except GeometryError:
        return False
    return True


def _onto_other(grid: Grid, output: Grid, distance: float, wavelength: float) -> Choice:
    """Points to points where that is small, paraxial and unaliased; otherwise the angular spectrum."""
    differ = _grids_differ(grid, output)
    ways = [
        abs(b - a) + (m + n) / 2
        for a, b, m, n in zip(grid.center, output.center, grid.size, output.size, strict=True)
    ]
    error = sampling.fresnel_phase_error(distance, math.hypot(*ways), wavelength) if distance else math.inf
    fine = all(
        way <= wavelength * abs(distance) / (2 * pitch) for way, pitch in zip(ways, grid.pitch, strict=True)
    )
    if error < LARGEST_PHASE_ERROR and fine and max(*grid.shape, *output.shape) <= MOST_POINTS:
        reason = f"{differ}, and the Fresnel approximation is only {error:.1g} rad off: points to points"
        return Choice("fresnel", 0.0, reason)
    return Choice("zoom", 0.0, differ)


def _grids_differ(grid: Grid, output: Grid) -> str:
    pitches = [" x ".join(f"{1e6 * p:.6g}" for p in g.pitch) for g in (grid, output)]
    if pitches[0] != pitches[1]:
        return f"the output's pitch of {pitches[1]} µm differs from the input's {pitches[0]} µm"
    return f"the output's samples fall between the input's, whose pitch is {pitches[0]} µm"


def _on_window(field: Field, grid: Grid) -> Field:
    """The field on another window of its own samples, zero where it has none."""
    if grid == field.grid:
        return field
    data = field.data
    step, between = samples_between(grid, field.grid)
    for axis, first in zip((-2, -1), between.samples_to(field.grid), strict=True):
        data = _window_along(data, axis, first, between.shape[axis])
    return replace(field, data=data[..., :: step[0], :: step[1]], grid=grid)


def _window_along(data: Array, axis: int, first: int, count: int) -> Array:
    n = data.shape[axis]
    start, stop = min(max(first, 0), n), min(max(first + count, 0), n)
    kept = data[..., start:stop, :] if axis == -2 else data[..., start:stop]
    one = data[..., :1, :] if axis == -2 else data[..., :1]
    before = min(max(-first, 0), count)
    parts = [kept]
    for where, missing in ((0, before), (2, count - before - (stop - start))):
        if missing:
            shape = list(data.shape)
            shape[axis] = missing
            xp = arrays.namespace(data)
            zeros = xp.broadcast_to(xp.zeros_like(one), tuple(shape))
            parts = [zeros, *parts] if where == 0 else [*parts, zeros]
    return arrays.namespace(data).concat(parts, axis=axis) if len(parts) > 1 else kept


def _check_method(method: str) -> None:
    if isinstance(method, str) and method in ("auto", *METHODS):
        return
    if method in _OF_THE_THESIS:
        raise SamplingError(
            f"method {method!r} is one of the thesis, kept for comparison. Import lumigraph.studies.thesis "
            'first, which adds it, or use method="band_limited".'
        )
    raise SamplingError(f"method is {method!r} but must be 'auto' or one of {', '.join(METHODS)}.")


def _check_pad(pad: float) -> None:
    if checks.finite("pad", pad, "windows") < 0:
        raise GeometryError(f"pad is {pad:g} but must be 0 or more: 1 doubles the window.")
