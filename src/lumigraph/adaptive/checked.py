"""Checks of depths and terms that are to be estimated, and the instrument with the estimated aberrations."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera, LightFieldMicroscope, PlenopticCamera
from lumigraph.instruments.capabilities import Decoded, WithPupil


class Kind(NamedTuple):
    """Kind of object: the terms that it explains itself, in words, and the reason for each."""

    all_of_it: str
    reasons: dict[int, str]


PISTON = "a piston changes no image"

PICTURE = Kind(
    "the picture explains 1 to 3 itself",
    {
        1: PISTON,
        2: "the picture's place along x explains it",
        3: "the picture's place along y explains it",
    },
)

BEADS = Kind(
    "the beads explain 1 to 4 themselves",
    {
        1: PISTON,
        2: "the beads' places along x explain it",
        3: "the beads' places along y explain it",
        4: "the beads' depths explain it",
    },
)

VOLUME = Kind(
    "the volume explains 1 to 4 itself",
    {
        1: PISTON,
        2: "the volume's place along x explains it",
        3: "the volume's place along y explains it",
        4: "the volume's depth explains it",
    },
)


def asked_for(
    instrument: LightFieldMicroscope | PlenopticCamera,
    depths: Sequence[float],
    terms: Sequence[int],
    kind: Kind,
) -> tuple[np.ndarray, tuple[int, ...], dict[int, str]]:
    """Planes [m], terms that can be found, and the others with reasons.

    Raises
    ------
    GeometryError
        Another configuration than "1.0", a camera's volume or beads, no depths, several of a picture, no
        terms.
    """
    _require_known(instrument, kind)
    planes = np.unique([checks.finite("a depth", float(dz)) for dz in depths])
    if not len(planes):
        raise GeometryError("there are no depths. Give some, such as each 6 µm.")
    if kind is PICTURE and len(planes) > 1:
        raise GeometryError(f"there are {len(planes)} depths but a picture stands at one. Give that.")
    asked = tuple(dict.fromkeys(int(j) for j in terms))
    found = tuple(j for j in asked if j not in kind.reasons)
    if not found:
        raise GeometryError(f"terms are {asked} but {kind.all_of_it}. Give others.")
    instrument.pupil_images(found)  # refuses what has no phase, and indices that are none
    return planes, found, {j: reason for j, reason in kind.reasons.items() if j in asked}


def _require_known(instrument: LightFieldMicroscope | PlenopticCamera, kind: Kind) -> None:
    if isinstance(instrument, LensletCamera) and isinstance(instrument, Decoded):
        if kind is not PICTURE:
            raise GeometryError(
                "aberrations of a PlenopticCamera need a 'picture', flat and at one known depth. For a point "
                "of light use adaptive.sense."
            )
    elif not isinstance(instrument, WithPupil) or instrument.configuration != "1.0":
        raise GeometryError(
            "aberrations are estimated for a LightFieldMicroscope of configuration '1.0', or a "
            "PlenopticCamera."
        )


Bent = TypeVar("Bent", bound=LightFieldMicroscope | LensletCamera)


def bent(instrument: Bent, terms: Sequence[int], coefficients: np.ndarray) -> Bent:
    """The instrument with aberrations beyond those of its description."""
    known = dict(known_of(instrument))
    for j, value in zip(terms, coefficients, strict=True):
        if value:
            known[j] = known.get(j, 0.0) + float(value)
    named = "main_lens" if isinstance(instrument, LensletCamera) else "objective"
    return instrument.replace(**{named: {"aberrations": known}})


def known_of(instrument: LightFieldMicroscope | LensletCamera) -> Mapping[int, float]:
    """Aberrations of an instrument's description: Noll index to waves rms."""
    bending = instrument.main_lens if isinstance(instrument, LensletCamera) else instrument.objective
    return bending.aberrations
