"""`prepare`: a raw image, and what is known of it, ready to use."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from os import PathLike
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

import numpy as np

from lumigraph import rendering
from lumigraph.calibration import aligned, calibrate
from lumigraph.calibration.devignette import as_raw, divided
from lumigraph.core import upper_floors
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.prepared import PreparedImage, Reason, Verdicts
from lumigraph.core.raw import RawImage
from lumigraph.core.saturation import saturation_level
from lumigraph.errors import CalibrationError, SamplingWarning
from lumigraph.preparation.agreement import Described, implied
from lumigraph.preparation.beside import ReferenceImages, above, black_plane, coloured
from lumigraph.preparation.calibration_file import read_calibration
from lumigraph.preparation.doubts import check_kinds, doubts_of, floor_under
from lumigraph.preparation.drift import check_drift
from lumigraph.preparation.validity import pixel_reasons, verdicts
from lumigraph.preparation.vignetting import vignetting

Options = ParamSpec("Options")
Made = TypeVar("Made")
Seen = TypeVar("Seen", covariant=True)


def prepare(
    raw: RawImage | Array,
    calibration: Calibration | str | PathLike[str] | None = None,
    *,
    white: RawImage | Array | None = None,
    dark: RawImage | Array | None = None,
    camera: Described | str | PathLike[str] | None = None,
    mask: Array | None = None,
    divide: bool = True,
) -> PreparedImage:
    """A raw image that is ready to use, with its calibration, valid pixels and lenslets, and notes.

    The lattice is that of `calibration`, else it is found on the white image, else it is the camera's. A
    maker's is moved to the micro-images. It is compared with the raw image's own lattice where that shows,
    and with the camera's. The dark image is subtracted, the white image divided out, a mosaic demosaiced.

    Parameters
    ----------
    raw
        Raw image as it was read (y, x[, c]).
    calibration
        Calibration of the micro-images, or its file.
    white
        Picture of an evenly lit surface with the same settings.
    dark
        Picture with the lens covered: shows which pixels shine by themselves, too.
    camera
        Camera description: gives lengths, and the lattice where nothing else does; one without lenslets is
        not looked at.
    mask
        Pixels to use (y, x), true or false; None for all.
    divide
        False leaves the values as they were read, for `lumigraph.deconvolve`, whose model takes the
        `background` and the `response` instead: dividing would spoil the statistics of the noise.

    Returns
    -------
    PreparedImage
        A `RawImage` that also has `calibration`, `valid`, `reasons`, `lenslets` and `notes`.

    Raises
    ------
    CalibrationError
        Another size, a lattice that slips by half a pitch or more against the raw image's own, a white
        image without light, values that are not finite.

    Warns
    -----
    SamplingWarning
        The lattice slips a little, a maker's lattice was moved, or picture and camera disagree.

    Examples
    --------
    >>> import lumigraph as lg
    >>> camera = lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1").replace(
    ...     lenslets={"pitch": "150 um", "focal_length": "5 mm", "count": (5, 5)})
    >>> ready = prepare(np.ones(camera.sensor.shape, np.float32), camera=camera)
    >>> ready.valid.shape == camera.sensor.shape, ready.notes[0]
    (True, 'the lattice is that of the camera file')
    """
    camera = upper_floors.camera(camera)
    calibration = _read(calibration, raw)
    beside = ReferenceImages(*(None if one is None else as_raw(one) for one in (white, dark)))
    raw = as_raw(raw)
    beside.check(raw)
    check_kinds(raw, beside)
    found, notes = _placed(raw, calibration, beside.white, camera)
    notes += _flat(raw)
    pitch = None if found is None else found.lattice.pitch
    for doubt in (beside.doubt(raw), *(() if pitch is None else doubts_of(raw, beside, pitch))):
        if doubt:
            _warn(notes, doubt)
    floor = None if pitch is None else floor_under(raw, beside, pitch)
    notes += [] if floor is None else [floor]
    reasons = pixel_reasons(raw, beside, found, _mask(mask, raw))
    lenslets = None if found is None else verdicts(reasons, found)
    notes = (*notes, *beside.notes(raw, divide=divide), *_full(raw), *_counted(reasons, lenslets))
    known: dict[str, Any] = {"calibration": found, "reasons": reasons, "lenslets": lenslets, "notes": notes}
    if divide:
        ready, known["divisor"] = _pictured(raw, beside)
    else:
        ready, known = raw, known | _modelled(raw, beside, found)
    return PreparedImage(ready.data, ready.pixel_pitch, ready.bit_depth, ready.bayer, ready.metadata, **known)


def _read(calibration: Calibration | str | PathLike[str] | None, raw: RawImage | Array) -> Calibration | None:
    """The calibration, of its file where that is given."""
    if isinstance(calibration, str | PathLike):
        return read_calibration(Path(calibration), as_raw(raw).shape)
    return calibration


def _placed(
    raw: RawImage, calibration: Calibration | None, white: RawImage | None, camera: Described | None
) -> tuple[Calibration | None, list[str]]:
    """Calibration of the micro-images, and notes on its source and on whether it agrees with the camera."""
    told = None if camera is None else camera.calibration
    if calibration is not None:
        found, notes = calibration, ["the lattice is that of the calibration"]
    elif white is not None:
        found = calibrate(white)
        notes = ["the lattice was found on the white image", *found.notes]
    elif told is not None:
        found, notes = told, ["the lattice is that of the camera file"]
    else:
        return None, ["the positions of the micro-images are not known"]
    found.check_fits(raw.shape)
    if found.by_maker:
        found = aligned(found, raw)
        if not found.by_maker:
            _warn(notes, f"the maker's lattice was {found.notes[-1]}")
    described = None if told is None else camera
    judged = check_drift(raw.data, found, described if found is told else None)
    notes += [] if judged is None else [judged.told()]
    if described is None or told is None:
        return found, notes
    if found is told:
        seen = [] if judged is None else [judged.seen(found.lattice)]
        return found, notes + [implied(one, described, used=False)[0] for one in seen]
    line, agree = implied(found.lattice, described)
    notes.append(line) if agree else _warn(notes, line)
    return _with_lengths(found, told), notes


def _flat(raw: RawImage) -> list[str]:
    """A note on a raw image of one value, on which no verb can find anything."""
    values = to_numpy(raw.data)
    if (low := values.min()) != values.max():
        return []
    return [f"all pixels of the raw image are {low:g}: there is nothing to see on it"]


def _full(raw: RawImage) -> list[str]:
    """A note on pixels that are full below what the numbers of the raw image can hold."""
    level, data = saturation_level(raw), to_numpy(raw.data)
    if level is None or data.dtype.kind not in "ui" or level >= np.iinfo(data.dtype).max:
        return []
    many = int((data >= level).sum())
    return (
        [f"{many} values are {level:.0f}, which is taken for full. Give the bit depth if it is not"]
        if many
        else []
    )


def _warn(notes: list[str], line: str) -> None:
    notes.append(line)
    warnings.warn(line, SamplingWarning, stacklevel=4)


def _with_lengths(found: Calibration, told: Calibration) -> Calibration:
    """The calibration with the lengths of a camera where it has none."""
    names = ("pixel_pitch", "separation", "lenslet_distance")
    missing = {name: getattr(told, name) for name in names if getattr(found, name) is None}
    return replace(found, **missing) if missing else found


def _mask(mask: Array | None, raw: RawImage) -> np.ndarray | None:
    if mask is None:
        return None
    used = np.asarray(to_numpy(mask)) != 0
    if used.shape != raw.shape or not used.any():
        raise CalibrationError(
            f"mask has shape {used.shape} and {int(used.sum())} true values but the raw image has "
            f"{raw.shape[0]} x {raw.shape[1]} pixels. Give true for each pixel to use."
        )
    return used


def _pictured(raw: RawImage, beside: ReferenceImages) -> tuple[RawImage, np.ndarray | None]:
    """Values that pictures are made of, above the dark, evenly lit, in colour; and what divided them."""
    dark, light = beside.dark or black_plane(raw), None
    if beside.white is not None:
        even, light = divided(raw, beside.white, dark=dark)
        light = (light if light.ndim == 2 else light.mean(2)).astype(np.float16)
    else:
        even = raw if dark is None else above(raw, dark)
    return even if raw.bayer is None else coloured(even, raw), light


def _modelled(raw: RawImage, beside: ReferenceImages, found: Calibration | None) -> dict[str, Any]:
    """Background and response that the model of a deconvolution takes from dark and white image."""
    dark = None if beside.dark is None else np.asarray(to_numpy(beside.dark.data), np.float64)
    if beside.white is None or found is None:
        return {"background": dark}
    white = np.asarray(to_numpy(beside.white.data), np.float64)
    lit = white - (0.0 if dark is None else dark)
    return {"background": dark, "response": vignetting(lit, found.lattice.pitch)}


def _counted(reasons: np.ndarray, lenslets: Verdicts | None) -> tuple[str, ...]:
    """Numbers of pixels and lenslets that do not count, by reason, and of all lenslets left out."""
    told = []
    for reason in Reason:
        pixels = int((reasons == reason).sum())
        many = 0 if lenslets is None else int((lenslets.reasons == reason).sum())
        if reason is not Reason.GOOD and pixels:
            told.append(f"{reason.name.lower()}: {pixels} of {reasons.size} pixels, {many} lenslets")
    if lenslets is not None:
        told.append(f"left out: {int(lenslets.lost.sum())} of {len(lenslets.reasons)} lenslets")
    return tuple(told)


class RawFunction(Protocol[Options, Seen]):
    """A function of a raw image, prepared or not, whose calibration may be left out."""

    def __call__(
        self, raw: RawImage | Array, calibration: Calibration | str | PathLike[str] | None = None,
        *args: Options.args, **options: Options.kwargs,
    ) -> Seen:  # fmt: skip
        """Result of the function for the raw image."""
        ...


def of_raw(
    function: Callable[Concatenate[RawImage, Calibration, Options], Made],
) -> RawFunction[Options, Made]:
    """The same function of any raw image: one that was not prepared is prepared before.

    The calibration may be left out where `prepare` has found one.
    """

    @wraps(function)
    def call(
        raw: RawImage | Array, calibration: Calibration | str | PathLike[str] | None = None,
        *args: Options.args, **options: Options.kwargs,
    ) -> Made:  # fmt: skip
        calibration = _read(calibration, raw)
        if not isinstance(raw, PreparedImage):
            raw = prepare(raw, calibration)
            calibration = raw.calibration
        place = calibration or raw.calibration
        if place is None:
            raise CalibrationError(
                "the positions of the micro-images are not known. Give a calibration, or use "
                "prepare(raw, white=...)."
            )
        return function(raw, place, *args, **options)

    return call


decode = of_raw(rendering.decode)
render = of_raw(rendering.render)
render_stack = of_raw(rendering.render_stack)
super_resolve = of_raw(rendering.super_resolve)
