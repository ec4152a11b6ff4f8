"""Calibration from a white image, or from a raw image alone: `calibrate`."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lumigraph.calibration.autocorrelation import SMALLEST_PITCH
from lumigraph.calibration.devignette import as_raw, grey
from lumigraph.calibration.few import few_discs
from lumigraph.calibration.period import Request
from lumigraph.calibration.tiles import LARGEST, in_tiles
from lumigraph.calibration.unlit import saturated, unlit
from lumigraph.calibration.vectors import UNEQUAL
from lumigraph.calibration.whole import FoundLattice, whole
from lumigraph.core import checks
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import LAYOUTS, Layout
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError

_DECIMALS = 6  # of a px, and of full light: what is beyond is a thousandth of what can be measured


def calibrate(
    white: RawImage | Array | Sequence[RawImage | Array],
    layout: Layout | None = None,
    pitch: float | None = None,
    *,
    rotation: float | None = None,
    pixel_pitch: float | None = None,
    separation: float | None = None,
    lenslet_distance: float | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Micro-image lattice of a white image, or of a raw image alone, with the centre of every micro-image.

    Candidates for the lattice come from autocorrelation and spectrum of the light and of its dark gaps, and
    are judged by all their harmonics. Centres come from the phase of each micro-image's first harmonic and
    are sharpened by the mean micro-image; the lattice from least squares with two free basis vectors, and
    tilt and radial distortion where the residuals ask for them (`fitting.fit` says when). Lenslets without
    light are listed as missing; one that stands off the lattice is not fitted, but it counts.

    On a raw image of a scene the gaps between micro-images are followed instead of their light, since a
    scene moves from one micro-image to the next; the result says so in its notes.

    Parameters
    ----------
    white
        Picture (y, x[, c]) of an evenly lit surface, or a list of several, or a raw image of any scene; a
        Bayer pattern is scaled to grey first.
    layout
        "square", "hex" or "rectangular" (two pitches); found by itself where None.
    pitch
        Distance of neighbouring micro-images [px], to 10 %, of a rectangular lattice the mean of its two;
        found by itself where None.
    rotation
        Direction of the rows of lenslets from +x towards +y [rad], to 2°; found by itself where None.
    pixel_pitch
        Pixel pitch of the sensor [m]; the white image's own where None.
    separation, lenslet_distance
        Main lens to lenslets and lenslets to sensor [m], where known: kept in the result, which `decode`
        and `rendered_grid` need for lengths in metres.
    progress
        Called with the fraction that is done.

    Returns
    -------
    Calibration
        Its lattice's index (0, 0) is the micro-image nearest to the middle of the picture.

    Raises
    ------
    CalibrationError
        NaN, no light, no lattice, fewer than 3 × 3 lenslets, several lattices that are about equally likely,
        or a pitch, rotation or layout that the picture does not support.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[:90, :120]
    >>> white = np.cos(np.pi * (y - 44) / 15) ** 2 * np.cos(np.pi * (x - 59) / 15) ** 2
    >>> print(calibrate(white).report())
    layout      square, 35 lenslets on 90 x 120 px
    pitch       15.000 px (15.000 along rows, 15.000 to the next row)
    rotation    +0.000 mrad (+0.000 deg)
    origin      (44.000, 59.000) px (y, x)
    residual    0.000 px rms, 0.000 px at worst
    missing     0 lenslets without light
    """
    first, original = _light(white)
    _check_request(layout, pitch, rotation)
    request, shape = Request(layout, pitch, rotation), (original.shape[0], original.shape[1])
    found = _found(original, request, progress)
    spots, model = found.fitted.spots, found.fitted.model(shape)
    rms = float(np.sqrt(((spots.centers - model.position(spots.indices)) ** 2).sum(-1).mean()))
    bright = max(float(np.percentile(spots.light, 95)), 1e-30)
    return Calibration(
        found.fitted.lattice, shape, spots.indices, np.round(spots.centers, _DECIMALS),
        rms if found.measured else math.nan,
        pixel_pitch if pixel_pitch is not None else first.pixel_pitch, separation, lenslet_distance,
        warp=found.fitted.warp, light=np.round(spots.light / bright, _DECIMALS), fill=found.fill,
        missing=unlit(original, model, spots.centers, white=found.white, few=found.how == "edges"),
        sharpness=found.sharpness,
        notes=(*found.notes, *_overexposed(first, model, spots.indices)),
    )  # fmt: skip


def _found(original: np.ndarray, request: Request, progress: Progress | None) -> FoundLattice:
    """The lattice by the edges of a few large discs, or by many small ones as a whole or in tiles."""
    if (few := few_discs(original, request)) is not None:
        return FoundLattice(few.fitted, "edges", white=True, fill=few.fill)
    large = max(original.shape) > LARGEST
    found = in_tiles(original, request, progress) if large else whole(original, request, progress)
    lattice = found.fitted.lattice
    if lattice.layout == "hex" or request.layout is not None:
        return found
    layout = "rectangular" if max(lattice.pitches) > UNEQUAL * min(lattice.pitches) else "square"
    return found._replace(fitted=found.fitted._replace(lattice=replace(lattice, layout=layout)))


def _overexposed(image: RawImage, model: Calibration, indices: np.ndarray) -> tuple[str, ...]:
    """Note about micro-images at the top of the range."""
    if not (many := saturated(image, model, indices)):
        return ()
    return (
        f"{many} of {len(indices)} micro-images are saturated in their middle: they count, but their light "
        "is not known; expose less",
    )


def _light(white: RawImage | Array | Sequence[RawImage | Array]) -> tuple[RawImage, np.ndarray]:
    """The first image, and the mean of all as one grey picture (y, x), each scaled to a mean of 1."""
    images = [as_raw(image) for image in white] if isinstance(white, list | tuple) else [as_raw(white)]
    if not images:
        raise CalibrationError("the list of white images is empty. Give at least one image.")
    for image in images:
        if image.shape != images[0].shape:
            raise CalibrationError(
                f"the white images have {images[0].shape} and {image.shape} pixels. "
                "Give images of one camera at one setting."
            )
        checks.brightness("the white image", image.data, CalibrationError)
    if len(images) == 1:
        return images[0], _picture(images[0])
    total = np.zeros(images[0].shape, np.float32)
    for picture in map(_picture, images):
        total += picture / max(abs(float(picture.mean())), 1e-30)
    return images[0], total / len(images)


def _check_request(layout: str | None, pitch: float | None, rotation: float | None) -> None:
    if not (layout is None or isinstance(layout, str)) or layout not in (None, *LAYOUTS):
        raise CalibrationError(
            f"layout is {layout!r} but must be 'square', 'hex' or 'rectangular', or left out."
        )
    if pitch is not None and checks.positive("pitch", pitch, "px", CalibrationError) < SMALLEST_PITCH:
        raise CalibrationError(
            f"pitch is {pitch:g} px but micro-images below {SMALLEST_PITCH:g} px cannot be separated. "
            "Use a sensor with smaller pixels, or lenslets farther apart."
        )
    if rotation is not None:
        checks.finite("rotation", rotation, "rad", CalibrationError)


def _picture(white: RawImage) -> np.ndarray:
    """The white image as one grey picture, refused where it is too small or flat."""
    ny, nx = white.shape
    least = int(3 * SMALLEST_PITCH)
    if min(ny, nx) < least:
        raise CalibrationError(
            f"the white image has {ny} x {nx} pixels but 3 x 3 lenslets need at least {least} x {least}. "
            "Use the whole sensor's picture."
        )
    picture = grey(white)
    low, high = float(picture.min()), float(picture.max())
    if high - low <= 1e-4 * max(abs(low), abs(high)):
        raise CalibrationError(
            f"the white image is flat: all its values lie between {low:g} and {high:g}. "
            "Take it through the lenslets, neither dark nor saturated."
        )
    return picture
