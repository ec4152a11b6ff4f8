"""The image of one point of light, by wave optics, on the few lenslets that it reaches."""

import math
import time
import warnings
from base64 import b64encode
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.picture import png
from lumigraph.errors import GeometryError, SamplingError, SamplingWarning
from lumigraph.instruments.loading import AnyCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate

MOST_ALONG = 15
"""Lenslets along each side that are simulated."""

MOST_SAMPLES = 9e6
"""Of a plane: about two seconds."""

_MOST_PIXELS = 1200
_LENSLET_PIXELS = 15  # of a microscope's point image


@dataclass(frozen=True, slots=True, eq=False)
class PointImage:
    """What the sensor sees of a point.

    Parameters
    ----------
    data
        Intensity (y, x), upright as raw images are.
    pixel_pitch
        [m].
    lenslets
        Along y and x, that were simulated; None without lenslets.
    notes
        Where the sampling is doubtful, and what was left out.
    """

    data: np.ndarray
    pixel_pitch: float
    lenslets: tuple[int, int] | None
    notes: tuple[str, ...]


def point_image(camera: Any, dz: float = 0.0) -> PointImage:
    """Of a point on the axis at depth `dz` [m] from the focused plane.

    The wave goes through the camera's own train of elements, with only as many lenslets as the light
    reaches; a microscope's by its operator, with the scalar model.

    Raises
    ------
    GeometryError
        A depth inside the focal length.
    SamplingError
        Planes too large for an answer at once.
    """
    if camera.KIND == "light-field-microscope":
        return _microscope(camera, dz)
    small: Any = camera
    if camera.KIND != "single-lens":
        count = _reached(camera, dz)
        small = camera.replace(
            lenslets={"count": count}, sensor={"shape": None}, main_lens={"diameter": camera.pupil_diameter}
        )
    else:
        count = None
    camera.defocused(dz)
    _check(small)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        raw = simulate(small, targets.points([(0.0, 0.0, dz)]))
    notes = tuple(str(each.message) for each in caught if issubclass(each.category, SamplingWarning))
    return PointImage(_middle(to_numpy(raw.data)), camera.pixels.pixel_pitch, count, notes)


def shown(image: PointImage, gamma: float = 0.5) -> dict[str, Any]:
    """The picture as a page needs it: a PNG whose brightness is (intensity / largest) ** gamma."""
    top = float(image.data.max()) or 1.0
    grey = np.rint(255 * np.clip(image.data / top, 0, 1) ** gamma).astype(np.uint8)
    return {
        "png": "data:image/png;base64," + b64encode(png(grey)).decode(), "shape": list(grey.shape),
        "pixel_pitch": image.pixel_pitch, "lenslets": image.lenslets, "notes": list(image.notes),
    }  # fmt: skip


def timed(camera: AnyCamera, dz: float) -> dict[str, Any]:
    """`shown` with the seconds that it took."""
    started = time.perf_counter()
    answer = shown(point_image(camera, dz))
    return answer | {"seconds": time.perf_counter() - started}


def _reached(camera: Any, dz: float) -> tuple[int, int]:
    """Odd numbers of lenslets (ny, nx) that a point's light reaches, two more, and no more than there are."""
    blur = camera.pupil_diameter * abs(
        1 - camera.separation * (1 / camera.main_lens.focal_length - 1 / camera.defocused(dz))
    )
    airy = 2.44 * camera.wavelength * camera.separation / camera.pupil_diameter
    wanted = 2 * math.ceil((blur + 2 * airy) / camera.lenslets.pitch / 2) + 3
    y, x = (min(max(wanted, 5), n, MOST_ALONG) for n in camera.lenslets.count)
    return y, x


def _check(camera: Any) -> None:
    sampling = camera.sampling
    grids = [sampling.pupil_grid, sampling.image_grid, sampling.lenslet_grid]
    largest = max(math.prod(grid.shape) for grid in grids if grid is not None)
    if largest > MOST_SAMPLES:
        raise SamplingError(
            f"the point's image needs planes of {largest:.3g} samples, more than the {MOST_SAMPLES:.3g} that "
            "are simulated at once. Use 'lumigraph simulate', or a slower main lens."
        )


def _middle(data: np.ndarray) -> np.ndarray:
    """The middle of a large picture."""
    cut = [slice(max(0, (n - _MOST_PIXELS) // 2), max(0, (n - _MOST_PIXELS) // 2) + _MOST_PIXELS)
           for n in data.shape[:2]]  # fmt: skip
    return data[cut[0], cut[1]]


def _microscope(scope: Any, dz: float) -> PointImage:
    count = tuple(min(n, 9) for n in scope.lenslets.count)
    if scope.configuration == "fourier":
        operator = scope.replace(sensor={"shape": None}).operator((dz,))
        pixels, pitch = None, scope.pixels.pixel_pitch
    else:
        pixels = _LENSLET_PIXELS
        pitch = scope.micro_image_pitch / pixels
        small = scope.replace(
            lenslets={"count": count}, sensor={"shape": None}, objective={"model": "scalar"}, bandwidth=None
        )
        operator = small.operator((dz,), 1, pixels=pixels)
    (_, ny, nx) = operator.shape[1]
    if not math.isfinite(dz):
        raise GeometryError(f"the depth is {dz} but must be finite.")
    notes = () if pixels is None else (f"scalar model, one wavelength, {pixels} × {pixels} px per lenslet",)
    data = to_numpy(operator.psf((0, ny // 2, nx // 2)))
    return PointImage(_middle(data), pitch, count if pixels else None, notes)  # type: ignore[arg-type]
