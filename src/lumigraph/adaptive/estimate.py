"""`estimate`: aberrations from the light field, together with the object; here of beads."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from lumigraph.adaptive.misfit import Misfit
from lumigraph.adaptive.of_beads import of_beads
from lumigraph.adaptive.of_volume import of_volume
from lumigraph.adaptive.wavefront import Wavefront
from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure
from lumigraph.errors import GeometryError
from lumigraph.instruments import LightFieldMicroscope, PlenopticCamera

TERMS = tuple(range(5, 16))
"""Noll indices up to the fourth order that the object cannot explain."""

REMEDY = {
    "beads": "Ask for more terms, more depths or regions of the field, or look for a volume.",
    "volume": "Give depths that are closer together or reach farther, or more terms.",
    "picture": "Ask for more terms, give the picture's own depth, or crop what is not flat.",
}
"""Remedies, by kind of object, if it does not explain the raw image."""


def estimate(
    raw: RawImage | np.ndarray,
    microscope: LightFieldMicroscope | PlenopticCamera,
    depths: Sequence[float],
    terms: Sequence[int] = TERMS,
    *,
    regions: tuple[int, int] = (1, 1),
    exposure: Exposure | None = None,
    pixels: Calibration | None = None,
    object: Literal["beads", "volume", "picture"] = "beads",  # noqa: A002 - what it is called everywhere
    progress: Progress | None = None,
) -> Wavefront:
    """Aberrations of a light-field microscope or a plenoptic camera from one raw image, with the object.

    Of beads: Richardson-Lucy finds them, through no wavefront or through the one that the shifts of views
    show (see `start`), whichever is likelier. Then their places and light and the Zernike coefficients are
    fitted together, by Levenberg and Marquardt's steps on the Poisson likelihood, and Richardson-Lucy looks
    for more beads in what is left. Where balls of one width are worth it, beads are balls that shine evenly,
    and the width is fitted, too: see `Wavefront.bead_width`. A term stays if it gains more log-likelihood
    than ½ ln N for N pixels (Schwarz's criterion), and than the part of the expected width that it leaves
    costs (Laplace's approximation of the evidence); the others are 0. What is known before: a coefficient is
    of the order of 1 wave rms.

    Of any object with texture: the shifts of views give a start (see `start`), unless none is likelier. Then
    Richardson-Lucy's steps on a volume take turns with Gauss and Newton's on the coefficients, for which the
    volume's voxels are unknown, too, until the likelihood rises no more. Each time the volume begins even:
    what has adapted to a wrong wavefront resists a better one.

    Of a picture, something flat with texture at one known depth, in the same way, in as fine samples as
    points' images change by, with defocus among the terms. It is the only kind for cameras 1.0. Pixels
    behind the two outermost lenslets of a camera's array do not count.

    Parameters
    ----------
    raw
        As it was read.
    microscope
        Of configuration "1.0", or a `PlenopticCamera` with square lenslets. Aberrations of its description
        are taken as known.
    depths
        Planes in which beads are looked for, or of the volume [m], such as each 6 µm; the one of a picture.
    terms
        Noll indices. Piston, tilt and, but for a picture, defocus cannot be separated from the object's
        place: see `Wavefront.untold`.
    regions
        Of the field along y and x, each with coefficients of its own at its middle; linear between.
        Neighbours are expected to differ by 0.3 waves rms, or less if the fit shows that they are more alike.
    exposure
        Background, gain, dead pixels; None for what a `RawImage` records. Without a gain a grey value
        counts as one electron.
    pixels
        Calibration of a real camera.
    object
        "beads", sparse points or balls anywhere; "volume", anything, as samples of which three go into a
        lenslet; "picture", anything flat. A volume and a picture have one region.
    progress
        Called as ``progress(fraction)`` after each step; how many there will be is not known.

    Raises
    ------
    GeometryError
        If the configuration or the kind of object is not supported; no terms or depths are given; beads
        have fewer than two depths, or none is found; a picture has several depths; beads or a volume
        stand before a camera; or a volume or picture has regions.
    CalibrationError
        If the raw image has another shape, or is dark.
    SamplingError
        If it does not fit in memory.

    Warns
    -----
    SamplingWarning
        The object does not explain the raw image.

    References
    ----------
    G. Schwarz, Ann. Stat. 6, 461 (1978).
    """
    parted = _regions(regions)
    if object in ("volume", "picture"):
        if parted != (1, 1):
            raise GeometryError(
                f"regions are {parted} but a {object} has one. Crop the raw image, or use beads."
            )
        found = of_volume((raw, exposure, pixels), microscope, depths, terms, object, progress or silent)
        Misfit(found.pearson, found.pearson_deviation).warn(f"the {object} leaves", REMEDY[object])
        return found
    if object != "beads":
        raise GeometryError(f"object is {object!r} but must be 'beads', 'volume' or 'picture'.")
    found = of_beads((raw, exposure, pixels), microscope, depths, terms, parted, progress or silent)
    Misfit(found.pearson, found.pearson_deviation).warn(
        f"{len(found.beads.intensities)} beads leave", REMEDY["beads"]
    )
    return found


def _regions(regions: tuple[int, int]) -> tuple[int, int]:
    found = tuple(checks.whole("regions", n) for n in regions)
    if len(found) != 2:
        raise GeometryError(f"regions are {regions} but must be two whole numbers, along y and x.")
    return found[0], found[1]
