"""The painted scene before plenoptic cameras, by rays and so quickly; as glowing layers for microscopes."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import fft
from scipy.interpolate import make_interp_spline

from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.design import resolution
from lumigraph.errors import GeometryError
from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.instruments.capabilities import Decoded, Rendered, WithMainLens
from lumigraph.samples.still_life import LAYERS, Layer
from lumigraph.scene import Scene, Slice

Plenoptic = PlenopticCamera | FocusedPlenopticCamera

_FINE = 1024  # samples of a painted layer for the height of the picture
_MARGIN = 0.15  # heights painted beyond the picture, which rays from the rim of the main lens reach
_RAYS = 3  # through each lenslet, along each axis, for each sample of the sensor
_PER_LOBE = 3.0  # samples in λb/d, half the width of what a lenslet's diffraction makes of a point
_DEPTHS = 4.0  # depths of field from the focused plane to the nearest and to the farthest layer
_NEAR = 1 / 3  # of the way to the lenslets that the image of a camera 2.0 moves at most
_BAND = 1 << 19  # rays followed at a time
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class PortraitSample:
    """Recording of the painted scene by a plenoptic camera.

    Parameters
    ----------
    camera
        1.0 or 2.0.
    raw, white
        Images of the scene and of even light, without noise.
    depths
        From the nearest to the farthest layer, from the focused plane [m].
    lobe
        Half the width of what a lenslet's diffraction makes of a point, λb/d [px].
    """

    camera: Plenoptic
    raw: RawImage
    white: RawImage
    depths: tuple[float, float]
    lobe: float


def portrait(camera: Plenoptic, *, colour: bool = False, progress: Progress = silent) -> PortraitSample:
    r"""Raw and white image of the scene that `scene` paints, before a plenoptic camera, in some seconds.

    Rays go from the sensor through each lenslet, as a thin lens, and the main lens to the layers of the
    scene, where the front hides the back. The nearest and the farthest layer lie four depths of field from
    the focused plane, or less, so that their images move by a third of the way to the lenslets of a camera
    2.0. Diffraction blurs the layers by the main lens' incoherent transfer function, and the picture on the
    sensor by that of a square lenslet as wide as their pitch d:

    .. math:: H(f) = \max(0, 1 - |f_y| \lambda b / d) \max(0, 1 - |f_x| \lambda b / d)

    `lumigraph.simulate` follows waves, of things that do not hide one another, in minutes. Light that
    micro-images share where they overlap is left out.

    Parameters
    ----------
    camera
        1.0 or 2.0; its sensor adds no noise.
    colour
        True for a raw image (y, x, 3) of the colours, as a sensor of three chips records it; else of their
        luminance (y, x).
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        Another kind of camera.

    Examples
    --------
    >>> camera = PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    >>> small = camera.replace(lenslets={"count": (9, 9)}, sensor={"shape": None})
    >>> portrait(small).raw.shape == small.sensor.shape
    True
    """
    if not (isinstance(camera, Decoded | Rendered) and isinstance(camera, WithMainLens)):
        raise GeometryError(
            f"camera is of type {type(camera).__name__} but must be a PlenopticCamera or "
            "FocusedPlenopticCamera."
        )
    shape, pixel = camera.sensor.shape, camera.sensor.pixel_pitch
    lobe = camera.wavelength * camera.lenslet_distance / camera.lenslets.pitch / pixel
    step = max(1, math.floor(lobe / _PER_LOBE))
    rays, depth = _Rays.of(camera), _depth(camera)
    places = [step * np.arange(-(-n // step)) + (step - 1) / 2 for n in shape]
    layers = [_Painted.of(layer, camera, rays, depth, colour) for layer in LAYERS]
    white = np.zeros((len(places[0]), len(places[1]), 1), np.float32)
    light = np.zeros((*white.shape[:2], layers[0].light.shape[2]), np.float32)
    rows = max(1, _BAND // light.shape[1])
    for top in range(0, len(light), rows):
        part = slice(top, top + rows)
        for *places_of_rays, lit in rays.through(places[0][part, None], places[1]):
            light[part] += _composed(layers, *places_of_rays) * lit[..., None]
            white[part] += lit[..., None]
        progress(min(1.0, (top + rows) / len(light)))
    raw, even = (
        RawImage(_recorded(found / _RAYS**2, lobe / step, places, shape), pixel) for found in (light, white)
    )
    distance, part = camera.object_distance, depth / camera.object_distance
    depths = -distance * part / (1 + part), distance * part / (1 - part)
    return PortraitSample(camera, raw, even, depths, lobe)


def glowing(grid: Grid, depth: float) -> Scene:
    """The painted scene's lights, robot and leaves as slices that shine through one another.

    Parameters
    ----------
    grid
        Grid of their samples [m].
    depth
        Depths of the leaves before and of the wall behind the focused plane [m].

    Examples
    --------
    >>> [part.dz for part in glowing(Grid.square(32, 1e-6), 1e-5).parts]
    [1e-05, 0.0, -1e-05]
    """
    height = grid.size[0]
    y, x = ((axis / height).astype(np.float32) for axis in (grid.y[:, None], grid.x))
    parts = []
    for layer in (LAYERS[0], *LAYERS[2:]):
        canvas = layer.seen(y, x, (0.0, 0.0))
        dz = -depth * round(layer.parallax / LAYERS[-1].parallax) or 0.0
        parts.append(Slice((canvas.colour @ _LUMINANCE) * canvas.cover, grid, dz))
    return Scene(tuple(parts))


@dataclass(frozen=True, slots=True, eq=False)
class _Rays:
    """Rays that reach the sensor: their places in the main lens and in the focused plane."""

    camera: Plenoptic
    inside: np.ndarray  # (rows, columns) of lenslets that there are, from the index `first`
    first: np.ndarray
    height: float  # of the picture in the focused plane [m]

    @classmethod
    def of(cls, camera: Plenoptic) -> "_Rays":
        indices = camera.calibration.indices
        first = indices.min(0)
        inside = np.zeros(indices.max(0) - first + 1, bool)
        inside[tuple((indices - first).T)] = True
        reach = camera.lenslets.reach[0]
        return cls(camera, inside, first, 2 * reach * camera.object_distance / camera.separation)

    def through(self, y: np.ndarray, x: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
        """Rays to pixels (y, x): (y, x) in focus [heights], (v, u) on the main lens [diameters], whether lit.

        Once for each place on a lenslet. The raw image is turned by 180°, which is turned back here.
        """
        camera = self.camera
        calibration, pixel, separation = camera.calibration, camera.sensor.pixel_pitch, camera.separation
        middle = [n // 2 for n in camera.sensor.shape]
        y, x = np.broadcast_arrays(y, x)
        index = np.stack(calibration.index(y, x), -1)
        centers = calibration.position(index)
        kinds = calibration.lattice.kind(*np.moveaxis(np.asarray(index, int), -1, 0))
        focal, *rest = camera.lenslets.focal_length
        lengths = np.array((focal, *reversed(rest)))[kinds if rest else np.zeros_like(kinds)]
        at = np.asarray(index, int) - self.first
        known = np.asarray(((at >= 0) & (at < self.inside.shape)).all(-1))
        lit = known & self.inside[tuple(np.moveaxis(np.where(known[..., None], at, 0), -1, 0))]
        scale = 1 / (1 + camera.lenslet_distance / separation)
        images = [-(place - m) * pixel for place, m in zip((y, x), middle, strict=True)]
        lenslets = [-(centers[..., k] - middle[k]) * pixel * scale for k in (0, 1)]
        offsets = ((np.arange(_RAYS) + 0.5) / _RAYS - 0.5) * camera.lenslets.pitch
        for dy in offsets:
            for dx in offsets:
                found = [
                    self._back(p, c + d, d, lengths)
                    for p, c, d in zip(images, lenslets, (dy, dx), strict=True)
                ]
                (focus_y, v), (focus_x, u) = found
                yield focus_y, focus_x, v, u, lit & (v**2 + u**2 <= 0.25)

    def _back(self, image: Any, lenslet: Any, offset: float, lengths: Any) -> tuple[np.ndarray, np.ndarray]:
        """Along one axis: where a ray crosses the focused plane [heights] and the main lens [diameters]."""
        camera = self.camera
        slope = (image - lenslet) / camera.lenslet_distance + offset / lengths
        lens = lenslet - slope * camera.separation
        focus = lens + slope * camera.image_distance
        place = -focus * camera.object_distance / camera.image_distance
        return (place / self.height).astype(np.float32), (lens / camera.pupil_diameter).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class _Painted:
    """One layer: its light and cover on a raster, and how it moves over the main lens.

    Parameters
    ----------
    light
        (rows, columns, 1 or 3), from -1/2 - margin heights on; 0 where nothing covers.
    cover
        (rows, columns).
    parallax, slant
        As those of `still_life.Layer`, for the diameter of the main lens.
    """

    light: np.ndarray
    cover: np.ndarray
    parallax: float
    slant: float

    @classmethod
    def of(
        cls, layer: Layer, camera: Plenoptic, rays: _Rays, depth: float, colour: bool
    ) -> "_Painted":  # fmt: skip
        half = (0.5 + _MARGIN, 0.5 * _aspect(camera) + _MARGIN)
        y, x = (
            (np.arange(round(2 * h * _FINE), dtype=np.float32) + 0.5) / _FINE - np.float32(h) for h in half
        )
        canvas = layer.seen(y[:, None], x, (0.0, 0.0))
        cover = canvas.cover.astype(np.float32)
        cutoff = camera.pupil_diameter / (camera.wavelength * camera.object_distance) * rays.height / _FINE
        shown = canvas.colour if colour else (canvas.colour @ _LUMINANCE)[..., None]
        channels = np.moveaxis(shown * cover[..., None], -1, 0)
        light = np.stack([_low_passed(channel, cutoff) for channel in channels], -1)
        most = max(abs(one.parallax) for one in LAYERS)
        # A point at a depth dz moves by D dz/(z1 + dz) in the focused plane; the nearer layers have dz < 0.
        scale = -camera.pupil_diameter / camera.object_distance * depth / most / rays.height
        return cls(light, _low_passed(cover, cutoff), scale * layer.parallax, scale * layer.slant)

    def seen(self, y: np.ndarray, x: np.ndarray, v: np.ndarray, u: np.ndarray) -> tuple[Any, Any]:
        """Light and cover where rays meet the layer."""
        own = (y - self.parallax * v) / (1 + self.slant * v)
        columns = x - (self.parallax + self.slant * own) * u
        shape = self.cover.shape
        rows = np.clip(np.rint(own * _FINE + shape[0] / 2 - 0.5), 0, shape[0] - 1).astype(np.intp)
        columns = np.clip(np.rint(columns * _FINE + shape[1] / 2 - 0.5), 0, shape[1] - 1).astype(np.intp)
        flat = rows * shape[1] + columns
        return self.light.reshape(-1, self.light.shape[2])[flat], self.cover.ravel()[flat][..., None]


def _depth(camera: Plenoptic) -> float:
    """Distance from the focused plane to the nearest and the farthest layer [m], to first order."""
    f_number = camera.object_distance / camera.pupil_diameter
    depth = _DEPTHS * resolution.depth_of_field(camera.wavelength, f_number)
    if isinstance(camera, Rendered):
        along, relay = (
            (camera.object_distance / camera.image_distance) ** 2,
            camera.separation - camera.image_distance,
        )
        depth = min(depth, _NEAR * abs(relay) * along)
    return depth


def _aspect(camera: Plenoptic) -> float:
    rows, columns = camera.lenslets.reach
    return columns / rows


def _composed(layers: list[_Painted], y: Any, x: Any, v: Any, u: Any) -> np.ndarray:
    """Colours along rays, layers composed from back to front."""
    total = np.zeros((*y.shape, layers[0].light.shape[2]), np.float32)
    for layer in layers:
        light, cover = layer.seen(y, x, v, u)
        total = total * (1 - cover) + light
    return total


def _low_passed(picture: np.ndarray, cutoff: float) -> np.ndarray:
    """Picture through a lens of a round pupil, whose incoherent cut-off is so many cycles per sample."""
    fy, fx = fft.fftfreq(picture.shape[0]), fft.rfftfreq(picture.shape[1])
    part = np.minimum(np.hypot(fy[:, None], fx) / cutoff, 1.0)
    transfer = 2 / np.pi * (np.arccos(part) - part * np.sqrt(1 - part**2))
    spectrum: Any = fft.rfft2(picture)
    found: Any = fft.irfft2(spectrum * transfer.astype(np.float32), picture.shape)
    return found


def _recorded(light: np.ndarray, lobe: float, places: list[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """Pixels (y, x[, 3]) of light (rows, columns, 1 or 3) that diffraction blurs."""
    channels = [_upsampled(_diffracted(part, lobe), places, shape) for part in np.moveaxis(light, -1, 0)]
    return channels[0] if len(channels) == 1 else np.stack(channels, -1)


def _diffracted(light: np.ndarray, lobe: float) -> np.ndarray:
    """Light behind square lenslets whose cut-off is one cycle per `lobe` samples."""
    border = math.ceil(4 * lobe)
    wide: Any = np.pad(light, border)
    for axis, count in enumerate(wide.shape):
        transfer = np.maximum(0, 1 - np.abs(fft.rfftfreq(count)) * lobe).astype(np.float32)
        shape = (-1, 1) if axis == 0 else (1, -1)
        spectrum: Any = fft.rfft(wide, axis=axis)
        wide = fft.irfft(spectrum * transfer.reshape(shape), count, axis=axis)
    return np.maximum(wide[border:-border, border:-border], 0)


def _upsampled(light: np.ndarray, places: list[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """Samples at places of rows and columns, on all pixels."""
    for axis, (at, count) in enumerate(zip(places, shape, strict=True)):
        if len(at) != count:
            light = make_interp_spline(at, light, axis=axis, k=3)(np.clip(np.arange(count), at[0], at[-1]))
    return np.maximum(light, 0).astype(np.float32)
