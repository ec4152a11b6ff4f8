r"""Measures of a camera as built, beside its description: focus, depth, blur, micro-images.

A point at z1 has its image at z2 behind the main lens, a = L - z2 before the lenslets. Its place in the
micro-images moves from lenslet to lenslet, beside the micro-images' own middles, by p b z2/(a L). With the
distances of the camera that was meant (index 0), and without errors of single lenslets (see `single`), this
reads as an image at

.. math:: z_2' = \frac{L_0}{1 + r}, \quad r = \frac{a L}{p b z_2} \cdot \frac{p_0 b_0}{L_0}
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from lumigraph.design import thin_lens
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera, Row
from lumigraph.instruments.capabilities import Rendered
from lumigraph.tolerance.single import Differ, Sight, Single, last

STREHL = "lenslet Strehl ratio"


def measures(camera: LensletCamera, made: LensletCamera) -> tuple[Row, ...]:
    """Measures of a camera as built, lengths in metres.

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
    """Measures that only a camera as built has."""
    scatter = made.errors
    single = Single() if scatter is None else Single.of(made, scatter)
    near = focused_distance(made)
    yield Row("focused distance", near, "m", "object that lenslets, or the sensor behind them, see sharp")
    yield Row("focus shift", near - camera.object_distance, "m", "farther than the plane that was meant")
    corner = at_corner(made)
    shift = focused_distance(corner) - near
    yield Row("corner focus shift", shift, "m", "of the last lenslet, beyond the focus amid the array")
    read = read_distance(camera, corner) - made.object_distance
    yield Row("corner depth error", read, "m", "the same as depth error, before the last lenslet")
    yield from _of_lenslets(camera, made, single)
    if isinstance(made, Rendered):
        cone = made.pupil_diameter * abs(made.separation - made.image_distance) / made.image_distance
        yield Row("lenslets that see a point", cone / made.lenslets.pitch, "", "D |a| / (z2 p)")
    fill = made.micro_image_width / made.micro_image_pitch
    yield Row("micro-image fill", fill, "", "D b / L over p (1 + b/L): above 1 micro-images overlap")


def of_differing(camera: LensletCamera) -> Callable[[Differ], dict[str, float]]:
    """Measures of a camera as described, but for how single lenslets differ: those that follow from it."""
    sight = Sight.of(camera)

    def values(differ: Differ) -> dict[str, float]:
        single = Single.of(camera, differ, sight)
        return {row.name: float(row.value) for row in _of_lenslets(camera, camera, single)}

    return values


def _of_lenslets(camera: LensletCamera, made: LensletCamera, single: Single) -> Iterator[Row]:
    """Measures that change with lenslets that differ from each other."""
    read = read_distance(camera, made, single.slope)
    yield Row("depth error", read - made.object_distance, "m",
              "of a point in that plane, read with the distances that were meant")  # fmt: skip
    yield Row("blur at the object", _blur(made, single.factor), "m",
              "diameter of a point there; below 0 beyond focus")  # fmt: skip
    yield Row("blur behind a lenslet", _behind(made, single.factor), "m", "of a point, by geometry")
    if isinstance(made, Rendered):
        shift = focused_distance(made, single.factor) - focused_distance(made)
        yield Row("lenslet focus shift", shift, "m", "of a lenslet near the axis, beyond the others' focus")
    yield Row(STREHL, single.strehl, "", "of a lenslet near the axis, by its form alone")
    yield Row("light of a point", single.light, "", "on the axis, that lenslets do not lose by missing")
    for axis, shift in zip("yx", _corner_shift(camera, made, single), strict=True):
        yield Row(f"corner shift {axis}", shift, "px", "of the last micro-image from where it was meant")


def focused_distance(made: LensletCamera, factor: float = 1.0) -> float:
    """Object distance that a camera as built sees sharp [m]: through its lenslets, or on them.

    `factor` is that of a lenslet's focal length.

    Raises
    ------
    GeometryError
        There is none.
    """
    relay = 0.0
    if isinstance(made, Rendered):
        relay = 1 / (1 / (made.lenslets.focal_length[0] * factor) - 1 / made.lenslet_distance)
    return _real(made.main_lens.focal_length, made.separation - relay)


def at_corner(made: LensletCamera) -> LensletCamera:
    """A camera as built whose lenslets and pixels stand everywhere as they do at the last lenslet."""
    if made.lean is None:
        return made
    y, x = made.lattice.position(last(made.lenslets))[0]  # pyright: ignore[reportArgumentType]
    array, scale = made.lean.of_array(y, x), 1 + made.lenslet_distance / made.separation
    distance = made.lenslet_distance - array + made.lean.of_sensor(y * scale, x * scale)
    flat = {"array_tilt": (0.0, 0.0), "sensor_tilt": (0.0, 0.0), "array_bow": 0.0}
    built = made.built.model_copy(
        update={**flat, "separation": made.separation + array, "lenslet_distance": distance}
    )
    return made.replace(built=built)


def _real(focal_length: float, image: float) -> float:
    """Object distance of an image behind the main lens [m]."""
    if not image > focal_length:
        raise GeometryError(
            f"the camera as built would be focused beyond infinity: on an image {image * 1e3:.6g} mm behind "
            f"the main lens, whose focal length is {focal_length * 1e3:.6g} mm. Use tighter tolerances."
        )
    return thin_lens.object_distance(focal_length, image)


def read_distance(camera: LensletCamera, made: LensletCamera, slope: float = 0.0) -> float:
    """Distance that a point has whose micro-images are read with the camera that was meant [m].

    Its lattice of micro-images is measured, its distances, focal length and pixels are those meant. Decentred
    lenslets add a `slope` to its images.

    Raises
    ------
    GeometryError
        The reading is no real object.
    """
    image, length, pitch = made.image_distance, made.separation, made.lenslets.pitch
    lenslets_per_pixel = made.pixels.pixel_pitch * (length - image) * length
    lenslets_per_pixel /= pitch * (made.lenslet_distance * image + slope * (length - image) * length)
    meant = camera.lenslets.pitch * camera.lenslet_distance / (camera.pixels.pixel_pitch * camera.separation)
    return _real(camera.main_lens.focal_length, camera.separation / (1 + lenslets_per_pixel * meant))


def _behind(made: LensletCamera, factor: float) -> float:
    """Diameter of a point's image behind a lenslet [m]; of a 1.0 camera of one direction's."""
    f, b = made.lenslets.focal_length[0] * factor, made.lenslet_distance
    width = made.lenslets.pitch * made.lenslets.fill_factor
    nearness = 1 / (made.separation - made.image_distance) if isinstance(made, Rendered) else 0.0
    return width * (1 - b * (1 / f - nearness))


def _blur(made: LensletCamera, factor: float) -> float:
    """The same in the plane of the object; of a 1.0 camera what the main lens blurs on the lenslets."""
    to_object = made.object_distance / made.image_distance
    if isinstance(made, Rendered):
        relay = made.separation - made.image_distance
        return _behind(made, factor) * abs(relay) / made.lenslet_distance * to_object
    length = made.separation
    return made.pupil_diameter * (1 - length / made.image_distance) * made.object_distance / length


def _corner_shift(camera: LensletCamera, made: LensletCamera, single: Single) -> tuple[float, float]:
    """Shift (y, x) of the micro-image behind the last lenslet of the array, on the raw image [px]."""
    index = last(camera.lenslets)  # pyright: ignore[reportArgumentType] - frozen models can be hashed
    places = []
    for one in (at_corner(made), at_corner(camera)):
        scale = -(1 + one.lenslet_distance / one.separation) / one.pixels.pixel_pitch
        places.append(one.lattice.position(index)[0] * scale)
    shift = places[0] - places[1] - np.array(single.corner) / made.pixels.pixel_pitch
    return float(shift[0]), float(shift[1])


def is_finite(value: object) -> bool:
    """True if a value is a number that can be averaged."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
