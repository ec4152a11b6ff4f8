r"""What follows from a camera as built, beside what was meant: focus, depth, blur, micro-images.

A point at z1 has its image at z2 behind the main lens, a = L - z2 before the lenslets. Its place in the
micro-images moves from lenslet to lenslet, beside the micro-images' own middles, by p b z2/(a L). With the
distances of the camera that was meant (index 0) this reads as an image at

.. math:: z_2' = \frac{L_0}{1 + r}, \quad r = \frac{a L}{p b z_2} \cdot \frac{p_0 b_0}{L_0}
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from lumigraph.design import thin_lens
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera, Lenslets, Row
from lumigraph.instruments.capabilities import Rendered


def measures(camera: LensletCamera, made: LensletCamera) -> tuple[Row, ...]:
    """What follows from a camera as built, lengths in metres.

    Parameters
    ----------
    camera
        What was meant.
    made
        What was made of it, by `built`.

    Raises
    ------
    GeometryError
        The camera as built is focused on no real object.
    """
    return (*of_making(camera, made), *made.quantities())


def of_making(camera: LensletCamera, made: LensletCamera) -> Iterator[Row]:
    """Those that only a camera as built has."""
    yield from _focus(camera, made)
    fill = made.micro_image_width / made.micro_image_pitch
    yield Row("micro-image fill", fill, "", "D b / L over p (1 + b/L): above 1 micro-images overlap")
    for axis, shift in zip("yx", _corner_shift(camera, made), strict=True):
        yield Row(f"corner shift {axis}", shift, "px", "of the last micro-image from where it was meant")


def _focus(camera: LensletCamera, made: LensletCamera) -> Iterator[Row]:
    near = focused_distance(made)
    yield Row("focused distance", near, "m", "object that lenslets, or the sensor behind them, see sharp")
    yield Row("focus shift", near - camera.object_distance, "m", "farther than the plane that was meant")
    yield Row("depth error", read_distance(camera, made) - made.object_distance, "m",
              "of a point in that plane, read with the distances that were meant")  # fmt: skip
    yield Row("blur at the object", _blur(made), "m", "diameter of a point there; below 0 beyond focus")
    yield Row("blur behind a lenslet", _behind(made), "m", "of a point, by geometry")
    if isinstance(made, Rendered):
        cone = made.pupil_diameter * abs(made.separation - made.image_distance) / made.image_distance
        yield Row("lenslets that see a point", cone / made.lenslets.pitch, "", "D |a| / (z2 p)")


def focused_distance(made: LensletCamera) -> float:
    """Object distance that a camera as built sees sharp [m]: through its lenslets, or on them.

    Raises
    ------
    GeometryError
        There is none.
    """
    relay = 0.0
    if isinstance(made, Rendered):
        relay = 1 / (1 / made.lenslets.focal_length[0] - 1 / made.lenslet_distance)
    return _real(made.main_lens.focal_length, made.separation - relay)


def _real(focal_length: float, image: float) -> float:
    """Object distance of an image behind the main lens [m]."""
    if not image > focal_length:
        raise GeometryError(
            f"the camera as built would be focused beyond infinity: on an image {image * 1e3:.6g} mm behind "
            f"the main lens, whose focal length is {focal_length * 1e3:.6g} mm. Use tighter tolerances."
        )
    return thin_lens.object_distance(focal_length, image)


def read_distance(camera: LensletCamera, made: LensletCamera) -> float:
    """Distance that a point has whose micro-images are read with the camera that was meant [m].

    Its lattice of micro-images is measured, its distances, focal length and pixels are those meant.

    Raises
    ------
    GeometryError
        The reading is no real object.
    """
    image, length = made.image_distance, made.separation
    lenslets_per_pixel = made.pixels.pixel_pitch * (length - image) * length
    lenslets_per_pixel /= made.lenslets.pitch * made.lenslet_distance * image
    meant = camera.lenslets.pitch * camera.lenslet_distance / (camera.pixels.pixel_pitch * camera.separation)
    return _real(camera.main_lens.focal_length, camera.separation / (1 + lenslets_per_pixel * meant))


def _behind(made: LensletCamera) -> float:
    """Diameter of a point's image behind a lenslet [m]; of a 1.0 camera of one direction's."""
    f, b = made.lenslets.focal_length[0], made.lenslet_distance
    width = made.lenslets.pitch * made.lenslets.fill_factor
    nearness = 1 / (made.separation - made.image_distance) if isinstance(made, Rendered) else 0.0
    return width * (1 - b * (1 / f - nearness))


def _blur(made: LensletCamera) -> float:
    """The same in the plane of the object; of a 1.0 camera what the main lens blurs on the lenslets."""
    to_object = made.object_distance / made.image_distance
    if isinstance(made, Rendered):
        relay = made.separation - made.image_distance
        return _behind(made) * abs(relay) / made.lenslet_distance * to_object
    length = made.separation
    return made.pupil_diameter * (1 - length / made.image_distance) * made.object_distance / length


def _corner_shift(camera: LensletCamera, made: LensletCamera) -> tuple[float, float]:
    """Of the micro-image behind the last lenslet of the array, on the raw image [px]."""
    index = _last(camera.lenslets)  # pyright: ignore[reportArgumentType] - frozen models can be hashed
    places = []
    for one in (made, camera):
        scale = -(1 + one.lenslet_distance / one.separation) / one.pixels.pixel_pitch
        places.append(one.lattice.position(index)[0] * scale)
    return float(places[0][0] - places[1][0]), float(places[0][1] - places[1][1])


@lru_cache(maxsize=16)
def _last(lenslets: Lenslets) -> np.ndarray:
    """Index of the last lenslet (1, 2)."""
    return lenslets.indices()[-1:]


def is_finite(value: object) -> bool:
    """Whether a value is a number that can be averaged."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
