"""`estimate`: aberrations from the light field, together with the object; here of beads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np

from lumigraph.adaptive.checked import BEADS, asked_for, bent
from lumigraph.adaptive.field import PRIOR, Nodes
from lumigraph.adaptive.fit import OWN, PLACES, Fit, Model, solved
from lumigraph.adaptive.misfit import Misfit
from lumigraph.adaptive.of_volume import of_volume
from lumigraph.adaptive.search import Search
from lumigraph.adaptive.start import starts
from lumigraph.adaptive.wavefront import Wavefront
from lumigraph.adaptive.worth import UNKNOWN, worth
from lumigraph.core import checks, memory
from lumigraph.core.calibration import Calibration
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.instruments import LightFieldMicroscope, PlenopticCamera
from lumigraph.scene import Points

TERMS = tuple(range(5, 16))
"""Noll indices up to the fourth order that the object cannot explain."""

ACCURACY = 3e-2
"""Of points' images: their errors are not alike from bead to bead, and less than noise."""

COARSE = 0.3
"""Accuracy asked of their derivatives, which then are off by 4 to 11 %, and single ones by up to 36 %."""

ROUNDS = 3
"""How often beads are looked for at most: in the raw image, then in what those before leave."""

STEPS = {"places": 4, "all": 40}
"""Of the fit, at most."""

SPREAD = 3.0
"""Pixels that beads light through aberrations of 1 wave rms, over those without: 2.7 before a 20x/0.5."""

REMEDY = {
    "beads": "Ask for more terms, more depths or regions of the field, or look for a volume.",
    "volume": "Give depths that are closer together or reach farther, or ask for more terms.",
    "picture": "Ask for more terms, give the picture's own depth, or crop what is not flat.",
}
"""Where an object does not explain the raw image."""


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
    for more beads in what is left. A term stays if it gains more log-likelihood than ½ ln N for N pixels
    (Schwarz's criterion), and than the part of the expected width that it leaves costs (Laplace's
    approximation of the evidence); the others are 0. What is known before: a coefficient is of the order of 1
    wave rms.

    Of any object with texture: the shifts of views give a start (see `start`), unless none is likelier. Then
    Richardson-Lucy's steps on a volume take turns with Gauss and Newton's on the coefficients, for which the
    volume's voxels are unknown, too, until the likelihood rises no more. Each time the volume begins even:
    what has adapted to a wrong wavefront resists a better one.

    Of a picture, something flat with texture at one known depth, in the same way, in as fine samples as
    points' images change by: defocus is told then. For cameras 1.0 it is the only one. Pixels behind the two
    outermost lenslets of a camera's array do not count.

    Parameters
    ----------
    raw
        As it was read.
    microscope
        Of configuration "1.0", or a `PlenopticCamera`, with square lenslets. Aberrations of its
        description are taken as known.
    depths
        Planes in which beads are looked for, or of the volume [m], such as each 6 µm; the one of a picture.
    terms
        Noll indices. Piston, tilt and, but for a picture, defocus cannot be told from the object's place: see
        `Wavefront.untold`.
    regions
        Of the field along y and x, each with coefficients of its own at its middle; linear between.
        Neighbours are expected to differ by 0.3 waves rms, or less if the fit shows that they are more alike.
    exposure
        Background, gain, dead pixels; None for what a `RawImage` records. Without a gain a grey value
        counts as one electron.
    pixels
        Calibration of a real camera.
    object
        "beads", sparse points anywhere; "volume", anything, as samples of which three go into a lenslet;
        "picture", anything flat. A volume and a picture have one region.
    progress
        Called as ``progress(fraction)`` after each step; how many there will be is not known.

    Raises
    ------
    GeometryError
        Another configuration, no terms, no depths, fewer than two of them or no beads where those are
        looked for, several of a picture, another kind of object, beads or a volume before a camera, regions
        of a volume or picture.
    CalibrationError
        A raw image of another shape, or a dark one.
    SamplingError
        It does not fit in memory.

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
    given = _Given.of((raw, exposure, pixels), microscope, depths, terms)
    model = given.model(parted, progress or silent)
    none = np.zeros((len(model.nodes), len(given.terms)))
    first = Fit(given.search.beads(given.problem), none)
    _require_memory(model, first)
    every = np.ones(len(given.terms), bool)
    plain = model.placed(first, STEPS["places"])
    fit, rounds = _fitted(given, model, _begun(given, model, plain), every)
    if len(model.nodes) > 1:
        nodes = model.nodes.learnt(fit.coefficients, covariance_of_coefficients(model, fit))
        model = replace(model, nodes=nodes)
        fit = model.improved(fit, every, STEPS["all"])
    full, covariance = fit.coefficients, covariance_of_coefficients(model, fit)
    free = worth(covariance, fit.coefficients, model.counted, model.nodes.information)
    if not free.all():
        fit = model.improved(fit.changed(coefficients=fit.coefficients * free), free, STEPS["all"])
    left_out = (fit.coefficients - full).ravel()
    covariance += np.outer(left_out, left_out)
    misfit = model.misfit(fit)
    misfit.warn(f"{len(fit.points.intensities)} beads leave", REMEDY["beads"])
    shape = (len(model.nodes.y), len(model.nodes.x), len(given.terms))
    deviations = np.sqrt(np.diag(covariance)).reshape(shape)
    unknown = {j: UNKNOWN for j, d in zip(given.terms, deviations.max((0, 1)), strict=True) if d > PRIOR / 2}
    found = fit.coefficients.reshape(shape)
    return Wavefront(
        given.terms, found, deviations, (model.nodes.y, model.nodes.x), given.untold | unknown, fit.points,
        (model.deviance(plain), model.deviance(fit)), misfit.pearson, rounds, fit.steps,
        bent(given.microscope, given.terms, found.mean((0, 1))), covariance,
        pearson_deviation=misfit.deviation,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Given:
    """What is given, put together."""

    microscope: LightFieldMicroscope
    search: Search
    problem: Problem
    terms: tuple[int, ...]
    untold: dict[int, str]
    pixels: Calibration | None

    @classmethod
    def of(
        cls,
        given: tuple[RawImage | np.ndarray, Exposure | None, Calibration | None],
        instrument: LightFieldMicroscope | PlenopticCamera,
        depths: Sequence[float],
        terms: Sequence[int],
    ) -> "_Given":
        raw, exposure, pixels = given
        planes, found, untold = asked_for(instrument, depths, terms, BEADS)
        microscope = cast("LightFieldMicroscope", instrument)  # cameras have no beads
        if len(planes) < 2:
            raise GeometryError(
                f"depths are {list(planes)} but beads need at least two planes to stand between."
            )
        if exposure is None:
            exposure = Exposure.of(raw) if isinstance(raw, RawImage) else Exposure()
        search = Search.of(microscope, found, planes, (raw, exposure, pixels), ACCURACY)
        return cls(microscope, search, search.problem(np.zeros(len(found))), found, untold, pixels)

    def model(self, regions: tuple[int, int], progress: Progress) -> Model:
        """Of the pixels."""
        images = replace(self.search.sight.images, accuracy=ACCURACY)
        nodes = Nodes.of(self.search.sight.picture, regions, len(self.terms))
        coarse = replace(images, accuracy=COARSE)
        return Model(images, self.problem, nodes, self.search.limits, progress, coarse=coarse)

    def starts(self) -> list[np.ndarray]:
        """Coefficients (terms,) of the whole field, from the views' shifts."""
        return starts(self.problem, self.microscope, self.terms, self.pixels)


def _begun(given: _Given, model: Model, plain: Fit) -> Fit:
    """A fit without aberrations, or the beads that are seen through those of views' shifts, if likelier."""
    fits = [plain]
    for c in given.starts():
        everywhere = np.tile(c, (len(model.nodes), 1))
        fits.append(model.judged(plain.changed(coefficients=everywhere)))
    found = min(fits, key=lambda fit: fit.objective)
    if found is plain:
        return plain
    beads = given.search.beads(given.search.problem(found.coefficients[0]))
    return model.placed(found.changed(points=beads), STEPS["places"])


def _fitted(given: _Given, model: Model, fit: Fit, free: np.ndarray) -> tuple[Fit, int]:
    """The fit with all beads that are worth their unknowns, and how often they were looked for."""
    fit = _without_faint(model, model.fitted(fit, free, STEPS["all"]), free)
    for done in range(1, ROUNDS):
        more = given.search.more(fit, model.expected(model.light(fit)))
        if more is None:
            return fit, done
        both = Points(*(np.concatenate(two) for two in zip(_parts(fit.points), _parts(more), strict=True)))
        longer = _without_faint(model, model.fitted(fit.changed(points=both), free, STEPS["all"]), free)
        unknowns = OWN * (len(longer.points.intensities) - len(fit.points.intensities))
        if fit.objective - longer.objective < max(unknowns, 1) * math.log(model.counted):
            return fit, done
        fit = longer
    return fit, ROUNDS


def _parts(points: Points) -> tuple[np.ndarray, np.ndarray]:
    return points.positions, points.intensities


def _without_faint(model: Model, fit: Fit, free: np.ndarray) -> Fit:
    """The fit without beads whose light is not known well enough to be there."""
    fit = model.known(fit)
    covariance = covariance_of(model, fit)
    light = np.diag(covariance)[PLACES : OWN * len(fit.points.intensities) : OWN]
    kept = light < 1 / (OWN * math.log(model.counted))
    if kept.all():
        return fit
    if not kept.any():
        raise GeometryError("no bead stands out of the noise. Give a raw image with more light, or of beads.")
    points = Points(fit.points.positions[kept], fit.points.intensities[kept])
    return model.improved(fit.changed(points=points), free, STEPS["all"])


def covariance_of(model: Model, fit: Fit) -> np.ndarray:
    """Of all unknowns; larger where the beads do not explain the raw image."""
    whole = model.around(fit).information / max(model.misfit(fit).pearson, 1.0)
    n = len(model.nodes.information)
    whole[-n:, -n:] += model.nodes.information
    return solved(whole, np.eye(len(whole)))


def covariance_of_coefficients(model: Model, fit: Fit) -> np.ndarray:
    """The part (nodes terms, nodes terms) of it [waves² rms]."""
    return covariance_of(model, fit)[-fit.coefficients.size :, -fit.coefficients.size :]


def _require_memory(model: Model, fit: Fit) -> None:
    """Of the changes of the pixels that each bead lights, before and after a step."""
    images, count = model.coarse or model.images, len(fit.points.intensities)
    farthest = float(np.abs(fit.points.positions[:, 2]).max())
    unknowns = OWN + fit.coefficients.shape[1]
    lit = images.share(farthest) * math.prod(images.shape)
    needed = 2 * SPREAD * 4.0 * count * unknowns * lit
    what = f"the derivatives of {images.shape} pixels by {count} beads and {unknowns} unknowns of each"
    memory.require(needed, what, "Crop the raw image.", SamplingError)


def _regions(regions: tuple[int, int]) -> tuple[int, int]:
    found = tuple(checks.whole("regions", n) for n in regions)
    if len(found) != 2:
        raise GeometryError(f"regions are {regions} but must be two whole numbers, along y and x.")
    return found[0], found[1]
