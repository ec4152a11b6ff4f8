"""Plenoptic 2.0 pictures: every micro-image's patch, turned and tiled without seams."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, namespace
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError
from lumigraph.rendering.decode import check_raw
from lumigraph.rendering.geometry import Frame
from lumigraph.rendering.interpolate import Interpolation, as_float, check_interpolation, sample, weighted
from lumigraph.rendering.patches import Layout, Patches, checked_focus

_BAND = 1 << 20  # picture samples handled at a time
_FARTHEST = 1.6  # pitches to the farthest lenslet that shows a place; one of each kind stands within 1
_SHARP = 1.5  # pixels of blur by which another kind of lenslet loses against the sharpest one


def render(
    raw: RawImage | Array,
    calibration: Calibration,
    patch: float | Array,
    *,
    samples: int | None = None,
    blend: bool = False,
    focus: Sequence[float] | None = None,
    interpolation: Interpolation = "cubic",
) -> Array:
    r"""Picture (y, x[, c]) of the main image plane behind a plenoptic 2.0 raw image.

    The micro-image centred at C shows the main image at X = c z2/L, and around it a copy m times as large,
    turned by 180° (Keplerian) or not (Galilean). For each sample of the picture the lenslet whose cell
    holds it is found, and the raw image is read at

    .. math:: C - \frac{patch}{P} (Y - C),

    where Y is the sample's place in the lattice of centres of pitch P. Tiles meet without seams for a patch
    of any size, whole or not, on square, hexagonal and turned lattices; tilt and distortion of the lattice
    are taken out of the picture. The picture's axes are the raw image's: a turned lattice does not turn it.

    Parameters
    ----------
    raw
        Pixels (y, x[, c]). Whole numbers become float32.
    calibration
        Of the same camera.
    patch
        Size of one tile on the sensor, m p z2 / L [px]: above 0 Keplerian, below 0 Galilean; or one size for
        each lenslet, (rows, cols) of `lenslet_indices`, for scenes of several depths: the sensor stays, so
        it is P b/a' z2'/L of each depth. With the right map the picture is sharp all over.
    samples
        Samples of the picture per lenslet; the patch size to the nearest whole number where None.
    blend
        Take the mean of all micro-images that show a place, weighted by a window about their centres, instead
        of the nearest one: less noise, and no seams. What lies at another depth than `patch` says is blurred,
        as by a large lens focused there. A map of patches is interpolated between the lenslets.
    focus
        For an array of three focal lengths: the patch [px] at which each kind of lenslet, `lattice.kind`, is
        sharp. The picture is blended, mostly of the kind that is sharp at each place's patch: a lenslet blurs
        by the difference of the two patches, in pixels.
    interpolation
        "linear", "cubic" or "band_limited", between the raw image's pixels.

    Raises
    ------
    GeometryError
        A patch of 0, NaN, larger than a micro-image, a map of another shape than the lenslets, or another
        number of `focus` than kinds of lenslets.
    CalibrationError
        The raw image has another size than the white image, NaN, or a Bayer pattern.
    LumigraphError
        It would not fit in memory.

    References
    ----------
    Georgiev and Lumsdaine, "Focused plenoptic camera and rendering", J. Electron. Imaging 19, 021106 (2010).
    Several focal lengths: Perwass and Wietzke, "Single lens 3D-camera with extended depth-of-field", Proc.
    SPIE 8291 (2012).

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.lattice import Lattice
    >>> lattice = Lattice.square(10.0, origin=(5, 5))
    >>> none = np.zeros((0, 2))
    >>> render(np.ones((40, 60)), Calibration(lattice, (40, 60), none, none, 0.0), 5.2).shape
    (19, 29)
    """
    raw = _checked(raw, calibration, interpolation)
    sizes = Patches.of(patch, calibration)
    layout = Layout.of(calibration, sizes, samples)
    source = _Source(calibration, sizes, blend or focus is not None, checked_focus(focus, calibration))
    return _picture(as_float(raw.data), layout, source, interpolation)


def render_stack(
    raw: RawImage | Array,
    calibration: Calibration,
    patches: Sequence[float] | np.ndarray,
    *,
    samples: int | None = None,
    focus: Sequence[float] | None = None,
    interpolation: Interpolation = "cubic",
) -> Array:
    """Pictures (n, y, x[, c]) focused on one plane for each patch, blended, all of the same places.

    What lies at the depth of a patch is sharp in its picture; what does not is blurred. See `render`.

    Parameters
    ----------
    raw, calibration, focus, interpolation
        As for `render`.
    patches
        One size [px] for each picture, all of one sign.
    samples
        Samples per lenslet; the largest patch to the nearest whole number where None.

    Raises
    ------
    GeometryError
        No patches, both signs, or sizes that no patch can have.
    """
    raw = _checked(raw, calibration, interpolation)
    if not isinstance(patches, Sequence | np.ndarray) or np.ndim(patches) != 1 or not len(patches):
        raise GeometryError(f"patches is {patches!r} but must be a list of sizes in pixels.")
    values = [checks.finite("patches", patch, "px") for patch in patches]
    if min(values) < 0 < max(values):
        raise GeometryError(
            f"patches are from {min(values):g} to {max(values):g} px but those of one camera have one sign. "
            "Give all above 0 (Keplerian) or all below 0 (Galilean)."
        )
    sizes = [Patches.of(patch, calibration) for patch in values]
    largest = max(sizes, key=lambda size: size.largest)
    layout, kinds = Layout.of(calibration, largest, samples), checked_focus(focus, calibration)
    data = as_float(raw.data)
    pictures = [
        _picture(data, layout, _Source(calibration, size, True, kinds), interpolation) for size in sizes
    ]
    return namespace(data).stack(pictures)


def rendered_grid(calibration: Calibration, patch: float | Array, samples: int | None = None) -> Grid:
    """Grid of the samples of a rendered picture in the main image [m].

    X = c z2 / L, with z2 / L from the patch: 1 - a/L, and a = b / (m z2/L + b/L). Where the calibration's
    pixel pitch, separation L or lenslet distance b is unknown, one lenslet's tile is 1.

    Parameters
    ----------
    calibration, patch, samples
        As given to `render`; of a map of patches, the median counts.

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.lattice import Lattice
    >>> none = np.zeros((0, 2))
    >>> calibration = Calibration(Lattice.square(10.0, origin=(5, 5)), (40, 60), none, none, 0.0)
    >>> rendered_grid(calibration, 5.2).pitch
    (0.2, 0.2)
    """
    sizes = Patches.of(patch, calibration)
    layout = Layout.of(calibration, sizes, samples)
    frame, scale = Frame.of(calibration), 1 / calibration.lattice.pitch
    pixel, distance, separation = (
        calibration.pixel_pitch,
        calibration.lenslet_distance,
        calibration.separation,
    )
    if pixel and distance and separation:
        magnified = sizes.middle / calibration.lattice.pitch * (1 + distance / separation)  # m z2 / L
        image_distance = distance / (magnified + distance / separation)
        scale = frame.lenslet_per_px * (1 - image_distance / separation)
    return _grid(layout, frame, scale)


def sight_grid(calibration: Calibration, patch: float | Array, samples: int | None = None) -> Grid:
    """Grid of the crossings of lenslets by rays from the middle of the main lens to a picture's samples.

    Each sample lies somewhere on its ray, at the depth that its own patch says.

    Parameters
    ----------
    calibration, patch, samples
        As given to `render`.
    """
    layout = Layout.of(calibration, Patches.of(patch, calibration), samples)
    frame = Frame.of(calibration)
    return _grid(layout, frame, frame.lenslet_per_px)


def _grid(layout: Layout, frame: Frame, scale: float) -> Grid:
    """Places of a layout [px], `scale` metres each, from the optical axis."""
    middle = layout.y[len(layout.y) // 2], layout.x[len(layout.x) // 2]
    center = [(place - axis) * scale for place, axis in zip(middle, frame.axis, strict=True)]
    pitch = layout.step * scale
    return Grid((len(layout.y), len(layout.x)), (pitch, pitch), (float(center[0]), float(center[1])))


def _checked(raw: RawImage | Array, calibration: Calibration, interpolation: str) -> RawImage:
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_interpolation(interpolation)
    check_raw(raw, calibration)
    return raw


def _picture(data: Array, layout: Layout, source: "_Source", interpolation: Interpolation) -> Array:
    """Picture (y, x[, c]) of an image (y, x[, c]), a band of rows at a time."""
    memory.require(
        16.0 * len(layout.y) * len(layout.x) * math.prod(data.shape[2:]),
        f"a picture of {len(layout.y)} x {len(layout.x)} samples",
        "Ask for {factor:.1f}x fewer samples.",
    )
    band = max(1, _BAND // len(layout.x))
    parts = []
    for k in range(0, len(layout.y), band):
        y, x = np.meshgrid(layout.y[k : k + band], layout.x, indexing="ij")
        total = None
        for places, weight in source.places(y, x):
            term = sample(data, places[0], places[1], interpolation)
            term = term if weight is None else weighted(term, weight, len(data.shape) - 2)
            total = term if total is None else total + term
        parts.append(total)
    return namespace(data).concat(parts, axis=0)


_Places = Iterator[tuple[tuple[np.ndarray, np.ndarray], np.ndarray | None]]


@dataclass(frozen=True, slots=True)
class _Source:
    """Places on the sensor that show each sample of the picture, and their weights."""

    calibration: Calibration
    sizes: Patches
    blend: bool
    focus: np.ndarray | None

    def places(self, y: np.ndarray, x: np.ndarray) -> _Places:
        """Places (y, x) [px] on the sensor of samples, and their weights, which add up to 1."""
        i, j = self.calibration.lattice.index(y, x)
        if self.blend:
            yield from self._blended(y, x, (i, j))
        else:
            yield self._seen(y, x, (i, j), self.sizes.at(i, j)), None

    def _seen(
        self,
        y: np.ndarray,
        x: np.ndarray,
        index: tuple[np.ndarray, np.ndarray],
        size: np.ndarray | float,
    ) -> tuple[np.ndarray, np.ndarray]:
        indices = np.stack(index, -1)
        flat, on_sensor = self.calibration.flat(indices), self.calibration.position(indices)
        ratio = size / self.calibration.lattice.pitch
        return (
            on_sensor[..., 0] - ratio * (y - flat[..., 0]),
            on_sensor[..., 1] - ratio * (x - flat[..., 1]),
        )

    def _blended(self, y: np.ndarray, x: np.ndarray, index: tuple[np.ndarray, np.ndarray]) -> _Places:
        lattice, (i, j) = self.calibration.lattice, index
        size = self.sizes.between(*self._fractional(y, x))
        # Two pixels from the edge of the micro-image, so that no tap falls into the next one.
        inside = max(0.5 * lattice.pitch - 2, 0.25 * lattice.pitch)
        reach = np.minimum(inside / np.abs(size), _FARTHEST) * lattice.pitch
        farthest = float(np.max(reach))
        steps = math.ceil(farthest / lattice.pitch * 1.2) + 1
        around = [(di, dj) for di in range(-steps, steps + 1) for dj in range(-steps, steps + 1)]
        near = [d for d in around if np.hypot(*(lattice.matrix @ d)) < farthest + 0.75 * lattice.pitch]
        trust = self._sharp(size)
        weights = [self._weight(y, x, (i + di, j + dj), reach, trust) for di, dj in near]
        weights[near.index((0, 0))] += 1e-6  # corners that no window reaches take the nearest lenslet
        total = np.sum(weights, axis=0)
        for (di, dj), weight in zip(near, weights, strict=True):
            if np.any(weight):
                yield self._seen(y, x, (i + di, j + dj), size), weight / total

    def _fractional(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lattice = self.calibration.lattice
        inverse, dy, dx = np.linalg.inv(lattice.matrix), y - lattice.origin[0], x - lattice.origin[1]
        return inverse[0, 0] * dy + inverse[0, 1] * dx, inverse[1, 0] * dy + inverse[1, 1] * dx

    def _sharp(self, size: np.ndarray | float) -> np.ndarray | None:
        """Weight of every kind of lenslets (kinds, ...) at places of a patch size; the sharpest one has 1.

        Behind a lenslet of pitch P, light that comes to a focus at another distance a' is spread over
        P |b/a' - b/a| on the sensor, which is the difference of the two patches.
        """
        if self.focus is None:
            return None
        blur = np.stack([np.square(np.asarray(size) - sharp) for sharp in self.focus])
        return np.exp(-(blur - blur.min(0)) / (2 * _SHARP**2))

    def _weight(
        self,
        y: np.ndarray,
        x: np.ndarray,
        index: tuple[np.ndarray, np.ndarray],
        reach: np.ndarray | float,
        trust: np.ndarray | None,
    ) -> np.ndarray:
        """Weight of a lenslet for samples around it; 0 where its micro-image is cut by the sensor's edge."""
        lattice, (ny, nx) = self.calibration.lattice, self.calibration.shape
        indices = np.stack(index, -1)
        flat, on_sensor = lattice.position(indices), self.calibration.position(indices)
        distance = np.minimum(np.hypot(y - flat[..., 0], x - flat[..., 1]) / reach, 1)
        half, cy, cx = lattice.pitch / 2, on_sensor[..., 0], on_sensor[..., 1]
        whole = (cy >= half - 1) & (cy + half <= ny) & (cx >= half - 1) & (cx + half <= nx)
        weight = np.cos(math.pi / 2 * distance) ** 2 * (distance < 1) * whole
        if trust is None:
            return weight
        kind = lattice.kind(*index)
        return weight * np.choose(kind, [np.broadcast_to(part, kind.shape) for part in trust])
