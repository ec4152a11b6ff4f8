r"""`find_shifts`: shifts of an object between raw images, measured on the raw images themselves.

Two raw images of an object differ by a shift, and by detail that lenslets do not resolve, which aliases
differently in each. So shifts are fitted to the likelihood of all raw images with the object integrated out
(`texture`), by steps of Gauss and Newton with Fisher's information. First much noise is assumed, which leaves
the coarse detail that leads to the right place, and then less and less.

K. V. Mardia & R. J. Marshall, Biometrika 71, 135 (1984), for likelihoods of fields by their covariances.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from lumigraph.core import upper_floors
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.core.short_repr import brief
from lumigraph.deconvolution import Exposure
from lumigraph.errors import CalibrationError, GeometryError, SamplingWarning
from lumigraph.instruments.capabilities import Decoded
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.microscope import LightFieldMicroscope
from lumigraph.metrology.scanning.joint import pairs_of
from lumigraph.metrology.scanning.lenslet_light import Lensed, LensletPixels
from lumigraph.metrology.scanning.texture import PartEvidence, PicturePart

REACH = 0.5
"""Standard deviation of shifts about their start, which limits the search [lenslets]."""

TOLD = 0.1
"""Standard deviation [lenslets] above which a shift is warned of; where all are above it they are refused."""

BLUNT = (0.3, 0.06, 0.012, 0.0024)
"""Noise that is assumed at first, over the texture's variance."""

MOST_STEPS, LONGEST, SETTLED = 40, 0.2, 0.3
"""Most steps; their largest length [lenslets]; and their size in standard deviations at the end."""

GAIN = 0.1
"""Gain of log-likelihood by the last step at which iterations end: spectra settle, too."""

MOST_VALUES, LEAST_LENSLETS, MOST_PARTS = 640, 16, 12
"""Largest size of a part of the picture, and how many parts are used: those with the most texture."""

ALIKE = 10
"""Number of parts whose shifts a prior of agreement is worth."""

MARGIN = 1.2
"""Factor of errors over those of Fisher's information, set on ten draws of each of some kinds of object:
other textures than Gaussian ones determine less. On other draws errors were 0.70 to 1.11 of those stated
(`python -m benchmarks.found_shifts pulls`)."""

BRIGHTER = 0.1
"""Light of a raw image beyond that of all in the mean, above which it is warned of."""

SPOTS = 4.0
"""Excess kurtosis of lenslets' light above which it is warned of: beads of 7 to 20 were found 1.4 to 8 times
as far off as told."""

LINES = 0.9
"""Part of the texture's variance in lines of one period above which it is warned of."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundShifts:
    """Measured shifts of an object.

    Parameters
    ----------
    shifts
        (k, 2) as (y, x) [m], for `joint_operator`. The first is as given: raw images show differences only.
    errors
        (k, 2), their standard deviations [m], with the object unknown; 0 of the first.
    covariance
        (2 (k - 1), 2 (k - 1)) of the others [m²], first of all y, then of all x.
    misfit
        Scatter of the shifts between parts of the picture over what is expected, squared: near 1. 1 of a
        picture that is one part.
    """

    shifts: np.ndarray
    errors: np.ndarray
    covariance: np.ndarray
    misfit: float

    __repr__ = brief


def find_shifts(
    raws: Sequence[RawImage],
    camera: Instrument | str | PathLike[str],
    start: Sequence[Sequence[float]] | np.ndarray | None = None,
    *,
    exposure: Exposure | Sequence[Exposure] | None = None,
    progress: Progress | None = None,
) -> FoundShifts:
    """Shifts of an object between raw images of a camera or microscope 1.0.

    Works on the light of each lenslet, and takes the object for an unknown texture whose spectrum is fitted,
    for each part of the picture apart. Any camera 1.0, of which the raw images show the pixels, and a flat
    object in focus. Before a microscope 1.0 the object may be deep: light from all depths moves alike.

    Parameters
    ----------
    raws
        Two or more, of one object that was moved, or of a camera that was (minus the shifts).
    camera
        Camera that took them, of kind "plenoptic", or a microscope of configuration "1.0".
    start
        Start of the search (k, 2) as (y, x) [m], such as `scan`, within half a lenslet in the object
        (one standard deviation) of the truth; the first is kept. None for no shifts.
    exposure
        Exposure of all raw images, or of each, with the gain; None for what `Sensor.expose` has recorded.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    CalibrationError
        One raw image, one of another shape, an unknown gain, no light, too few lenslets, or an object that
        does not show how it was moved, such as an even one.
    GeometryError
        A camera of another kind, or another number of shifts.

    Warns
    -----
    SamplingWarning
        A shift that is not told to a tenth of a lenslet, such as that along lines; lines of one period, finer
        ones of which lenslets show as coarser ones that move otherwise; shifts that have not settled; a raw
        image a tenth brighter or darker than the others; light of a few bright spots in the dark, such as
        beads, which shifts are told by less than a texture's errors say.

    Examples
    --------
    >>> found = lg.find_shifts(raws, camera, lg.scan(3, camera.lenslet_size))  # doctest: +SKIP
    >>> picture = lg.deconvolve(raws, lg.joint_operator(camera, shifts=found.shifts))  # doctest: +SKIP
    """
    of = _gathering(upper_floors.camera(camera))
    if not isinstance(raws, list | tuple) or len(raws) < 2:
        raise CalibrationError("shifts are between raw images. Give a list of two or more.")
    begun = np.array(pairs_of([(0.0, 0.0)] * len(raws) if start is None else start, len(raws)))
    known = [exposure] * len(raws) if exposure is None or isinstance(exposure, Exposure) else list(exposure)
    if len(known) != len(raws):
        raise CalibrationError(f"there are {len(known)} exposures for {len(raws)} raw images.")
    size = of.lenslet_size
    whole = LensletPixels.of(of).seen(raws, known)
    _warn_of_light(whole)
    _warn_of_spots(whole)
    parts = _parts(whole)
    found = _judged(_fitted(parts, begun / size, progress or silent), size)
    _warn_of_lines(parts[0])
    return found


def _gathering(camera: Instrument) -> Lensed:
    """Camera whose lenslets each gather the light of one place; others are refused."""
    if isinstance(camera, LightFieldMicroscope) and camera.configuration == "1.0":
        return camera
    if isinstance(camera, LensletCamera) and isinstance(camera, Decoded):
        return camera
    raise GeometryError(
        f'shifts are found for cameras of kind "plenoptic" and microscopes of configuration "1.0", not for '
        f"a {camera.noun}. Give them."
    )


def _parts(whole: PicturePart) -> list[PicturePart]:
    """Neighbouring lenslets together, few enough for their covariances; those with the most texture."""
    most = max(MOST_VALUES // len(whole.values), LEAST_LENSLETS)
    parts = [np.arange(len(whole.places))]
    while max(map(len, parts)) > most:
        parts = [half for part in parts for half in _halves(whole.places, part)]
    found = [whole.of(part) for part in parts]
    return sorted(found, key=lambda part: -part.variance / float(part.noise.mean()))[:MOST_PARTS]


def _halves(places: np.ndarray, part: np.ndarray) -> list[np.ndarray]:
    along = places[part][:, int(np.argmax(np.ptp(places[part], axis=0)))]
    return np.array_split(part[np.argsort(along, kind="stable")], 2)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Shifts (k, 2) [lenslets], the spectrum of each part, and the likelihood around them.

    Parameters
    ----------
    step
        Step to the likeliest shifts (2 (k - 1),), all y first.
    covariance
        Covariance of the shifts, from all parts and the start.
    """

    parts: Sequence[PicturePart]
    start: np.ndarray
    shifts: np.ndarray
    spectra: Sequence[np.ndarray]
    blunt: float
    told: Sequence[PartEvidence]
    step: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(
        cls,
        parts: Sequence[PicturePart],
        start: np.ndarray,
        shifts: np.ndarray,
        spectra: Sequence[np.ndarray],
        blunt: float,
    ) -> "_Fit":
        told = [part.told(shifts, one, blunt) for part, one in zip(parts, spectra, strict=True)]
        ways = [one.of_shifts() for one in told]
        slope = sum(way[0] for way in ways) - _row(shifts - start) / REACH**2
        covariance = np.linalg.inv(sum(way[1] for way in ways) + np.eye(len(slope)) / REACH**2)
        return cls(parts, start, shifts, spectra, blunt, told, covariance @ slope, covariance)

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the shifts, in the order of the step."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def off(self) -> float:
        """Size of the step in standard deviations."""
        return float(np.max(np.abs(self.step) / self.deviations))

    @property
    def likelihood(self) -> float:
        """Log-likelihood, the prior of the start included."""
        return sum(one.likelihood for one in self.told) - _far(self.shifts - self.start)

    def moved(self) -> tuple[np.ndarray, list[np.ndarray]] | None:
        """Shifts and spectra that are likelier; None where no step along the slope is."""
        part = min(1.0, LONGEST / float(np.abs(self.step).max()))
        for _ in range(5):
            shifts = self.shifts.copy()
            shifts[1:] += part * self.step.reshape(2, -1).T
            steps = [one.spectrum_step(part * self.step) for one in self.told]
            spectra = [one + part * step for one, step in zip(self.spectra, steps, strict=True)]
            if self._likelihood(shifts, spectra) > self.likelihood - 1e-6:
                return shifts, spectra
            part /= 3
        return None

    def _likelihood(self, shifts: np.ndarray, spectra: Sequence[np.ndarray]) -> float:
        found = zip(self.parts, spectra, strict=True)
        return sum(part.likelihood(shifts, one, self.blunt) for part, one in found) - _far(
            shifts - self.start
        )

    def misfit(self) -> float:
        """Scatter between parts, squared; 1 of one part."""
        count, scatter = len(self.step) * (len(self.told) - 1), 0.0
        for one in self.told:
            slope, information = one.of_shifts()
            left = slope - information @ self.step
            scatter += float(left @ np.linalg.pinv(information) @ left)
        return scatter / count if count else 1.0


def _row(shifts: np.ndarray) -> np.ndarray:
    return shifts[1:].T.ravel()


def _far(off: np.ndarray) -> float:
    return float((off[1:] ** 2).sum()) / (2 * REACH**2)


def _fitted(parts: Sequence[PicturePart], start: np.ndarray, progress: Progress) -> _Fit:
    """Most likely shifts, from a start."""
    shifts, spectra = start.copy(), [part.usual() for part in parts]
    fit, before, gained = None, -np.inf, np.inf
    for number in range(MOST_STEPS):
        blunt = BLUNT[number] if number < len(BLUNT) else 0.0
        fit = _Fit.of(parts, start, shifts, spectra, blunt)
        progress(number / MOST_STEPS)
        found = fit.moved()
        gained, before = fit.likelihood - before, fit.likelihood
        if blunt == 0 and (found is None or (fit.off < SETTLED and gained < GAIN)):
            break
        shifts, spectra = found or (shifts, spectra)
    else:
        _warn(
            f"the last of {MOST_STEPS} steps gained {gained:.2g} of log-likelihood: shifts have not settled, "
            "and errors are larger than stated. Use an object with texture in all directions"
        )
    progress(1.0)
    assert fit is not None  # there are steps
    return fit


def _judged(fit: _Fit, size: float) -> FoundShifts:
    """The shifts in metres with their errors, or why there are none."""
    misfit, count = fit.misfit(), len(fit.step) * (len(fit.told) - 1)
    wider = MARGIN**2 * max(1.0, (ALIKE + count * misfit) / (ALIKE + count))
    covariance = fit.covariance * wider * size**2
    errors = np.zeros_like(fit.shifts)
    errors[1:] = np.sqrt(np.diag(covariance)).reshape(2, -1).T
    each = np.einsum("akbk->kab", covariance.reshape(2, len(errors) - 1, 2, -1))
    worst, least = float(errors.max()), float(np.sqrt(np.linalg.eigvalsh(each).min()))
    if least > TOLD * size:
        raise CalibrationError(
            f"the raw images do not show how the object was moved: only to ± {least:.2g} m in any "
            f"direction, where a lenslet is {size:.2g} m wide. Use an object with texture, or more light."
        )
    if worst > TOLD * size:
        k, axis = np.unravel_index(int(errors.argmax()), errors.shape)
        _warn(
            f"the shift of raw image {k} along {'yx'[axis]} is known to ± {worst:.2g} m, and a lenslet is "
            f"{size:.2g} m wide. Use an object with texture in all directions"
        )
    return FoundShifts(fit.shifts * size, errors, covariance, misfit)


def _warn_of_light(whole: PicturePart) -> None:
    """Warn of raw images whose brightness differs from the known exposure."""
    means = whole.values.mean(1)
    k = int(np.argmax(np.abs(means - 1)))
    if abs(means[k] - 1) > BRIGHTER:
        _warn(
            f"raw image {k} is {means[k]:.3g} times as bright as all of them are in the mean: shifts may be "
            "wrong. Give its light, Exposure(light=...), or keep the object in the picture"
        )


def _warn_of_spots(whole: PicturePart) -> None:
    """Warn of spots in the dark, which are no Gaussian texture."""
    apart = whole.values - whole.values.mean()
    peaked = float(np.mean(apart**4) / np.mean(apart**2) ** 2) - 3
    if peaked > SPOTS:
        _warn(
            f"lenslets' light is that of some bright spots (excess kurtosis {peaked:.2g} > {SPOTS:g}): "
            "errors of shifts may be several times the stated ones. Use an object "
            "with texture, or measure the shifts"
        )


def _warn_of_lines(part: PicturePart) -> None:
    """Warn of lines of one period, which lenslets may show as coarser ones."""
    share = part.lines()
    if share > LINES:
        _warn(
            f"lines of one period are {100 * share:.0f} % of what the raw images show. Finer ones than "
            "lenslets resolve pass for coarser ones that move otherwise: shifts may be wrong by periods. Use "
            "an object with other texture"
        )


def _warn(what: str) -> None:
    warnings.warn(f"{what}.", SamplingWarning, stacklevel=4)
