"""A camera's optics behind glass: the thin lens in its exit pupil, and object space before it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.elements import ObjectSpace, ThinLens, Train
from lumigraph.elements.field_plate import FieldPlate, VignettedPupil, ZernikeMap
from lumigraph.errors import GeometryError
from lumigraph.instruments.glass import MARGIN, LensGlass
from lumigraph.operators import CameraOptics

ROUND = 0.02
"""Relative narrowing of the stop up to which there is no warning."""


@dataclass(frozen=True, slots=True)
class ExitPupil:
    """Exit pupil of a lens, and object distances before a thin lens placed there.

    Parameters
    ----------
    behind
        From the rear principal plane, positive behind [m]; 0 of a thin lens.
    focal_length, image_distance
        Focal length f and image distance z2 of the camera's thin lens [m].
    """

    behind: float
    focal_length: float
    image_distance: float

    @property
    def magnification(self) -> float:
        """Pupil magnification, its width over the entrance pupil's, m_p = 1 - e'/f."""
        return 1 - self.behind / self.focal_length

    @property
    def to_image(self) -> float:
        """Distance to the main lens' image, z2 - e' [m]."""
        return self.image_distance - self.behind

    @property
    def wider(self) -> float:
        """Width over that of the thin lens with the same aperture at the image."""
        return self.to_image / self.image_distance

    @property
    def object_distance(self) -> float:
        """Distance of the focused plane from a thin lens of focal length m_p f there [m]."""
        return 1 / (1 / (self.magnification * self.focal_length) - 1 / self.to_image)

    def to(self, separation: float) -> float:
        """Distance to a plane `separation` behind the rear principal plane [m]."""
        return separation - self.behind

    def check(self, name: str, separation: float) -> None:
        """Refuse a pupil that no thin lens can stand in.

        Raises
        ------
        GeometryError
            It lies behind the focal plane, where the entrance pupil is turned upside down, or behind the
            lenslets.
        """
        farthest = min(self.focal_length, separation, self.image_distance)
        if not self.behind < farthest:
            raise GeometryError(
                f"the exit pupil of {name!r} lies {self.behind * 1e3:.6g} mm behind its principal plane, but "
                f"must lie before {farthest * 1e3:.6g} mm, the nearest of focus, image and lenslets. "
                "Use a lens whose stop is farther in front."
            )


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """Chief rays over the fields of the thin lens in the exit pupil.

    Parameters
    ----------
    fields
        Tangents of images' heights over the pupil's distance.
    objects
        Object space of that lens.
    lean
        Extra inclination of chief rays over those from the exit pupil's middle on the axis [rad], outwards.
    """

    fields: tuple[float, ...]
    objects: ObjectSpace
    lean: np.ndarray

    def leans(self, field: np.ndarray) -> np.ndarray:
        """Inclination of chief rays at fields, tangents [rad]."""
        return np.interp(field, self.fields, self.lean)


def traced(glass: LensGlass, pupil: ExitPupil, object_distance: float) -> Traced:
    """Chief rays of a lens at a distance from the focused plane [m]."""
    at = np.array(glass.aberrations.x)
    height = pupil.image_distance * at
    stretch = np.append(1.0, 1 + glass.moved[1:] / height[1:])
    own = pupil.magnification * object_distance / pupil.object_distance * at
    lean = glass.turned + at - height * stretch / pupil.to_image
    fields = own * stretch
    if not (np.diff(fields) > 0).all():
        raise GeometryError(
            f"distortion folds the image: farthest out it is {stretch[-1]:.4g} times as high as without. "
            "Use a smaller field."
        )
    # What is seen on the axis has no direction
    lean[0] = 0.0
    return Traced(
        tuple(fields.tolist()), ObjectSpace(pupil.magnification, tuple(own.tolist()), stretch), lean
    )


def behind_glass(thin: CameraOptics, glass: LensGlass, found: Traced, pupil: ExitPupil) -> CameraOptics:
    """A camera whose thin main lens, with its plate, becomes the one in the exit pupil."""
    plate = next(part for part in thin.lens.elements if isinstance(part, FieldPlate))
    diameter = thin.pupil_diameter * pupil.wider
    aberrations, openings = glass.aberrations, glass.openings
    lens = FieldPlate(
        ZernikeMap(
            aberrations.terms, aberrations.values, found.fields, None, aberrations.wavelengths,
            aberrations.metres,
        ),
        diameter, plate.more,
        VignettedPupil(
            found.fields, openings.wavelengths, openings.axes, found.lean * pupil.to_image / (diameter / 2)
        ),
    )  # fmt: skip
    m = pupil.magnification
    return replace(
        thin, object_distance=pupil.object_distance, separation=pupil.to(thin.separation),
        pupil_diameter=diameter, lens=Train((lens, ThinLens(m * pupil.focal_length))),
        object_pitch=m * thin.object_pitch, objects=found.objects,
    )  # fmt: skip


def glass_warnings(glass: LensGlass | None, wavelength: float, *, angles: bool) -> Iterator[str]:
    """Warnings where the glass differs from its file, or has visible effects that are not simulated.

    Parameters
    ----------
    angles
        Whether the pixels behind the lenslets respond to angles.
    """
    if glass is None:
        return
    yield from (f"{note}." for note in glass.notes)
    along, across = glass.openings.at(glass.aberrations.x[-1] / MARGIN, wavelength)
    if angles and min(along, across) < 1 - ROUND:
        yield (
            f"the stop is {along:.3g} x {across:.3g} of its width farthest out: points and slices have that, "
            "white images a round one, as pixels respond to angles."
        )
