"""Settings of napari-LF that lie beside a raw image: a microscope, and its white and dark images."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lumigraph.errors import FormatError
from lumigraph.instruments import LightFieldMicroscope

FILE = "metadata.txt"
_LONGEST = 1 << 20  # bytes


@dataclass(frozen=True)
class Settings:
    """Microscope that napari-LF was told of, and the images with and without even light.

    Parameters
    ----------
    camera
        Its description, with as many lenslets as the raw image has.
    white, dark
        Files beside the raw image; None where they are missing.
    """

    camera: LightFieldMicroscope
    white: Path | None
    dark: Path | None


def settings_beside(raw: Path, shape: tuple[int, ...]) -> Settings | None:
    """Settings in metadata.txt beside a raw image of `shape` [px] that they name; None without such.

    Raises
    ------
    FormatError
        Settings for this raw image that are no microscope's.
    """
    path = raw.with_name(FILE)
    if not path.is_file() or path.stat().st_size > _LONGEST:
        return None
    try:
        found = json.loads(path.read_text("utf-8"))
    except ValueError:
        return None  # somebody else's file
    known = found.get("calibrate") if isinstance(found, dict) else None
    if not isinstance(known, dict) or "ulens_pitch" not in known:
        return None
    named = [part.get("input_file") for part in found.values() if isinstance(part, dict)]
    if raw.name not in named:
        return None
    try:
        camera = _microscope(known, shape)
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise FormatError(
            f"{path} names {raw.name} but describes no microscope: {str(error)[:120]}. "
            "Give --camera (camera=), or move the file away."
        ) from error
    white, dark = (_beside(raw, known.get(key)) for key in ("radiometry_frame_file", "dark_frame_file"))
    return Settings(camera, white, dark)


def _beside(raw: Path, name: Any) -> Path | None:
    """The file of that name in the raw image's folder, never elsewhere."""
    if not isinstance(name, str) or not name or Path(name).name != name:
        return None
    path = raw.with_name(name)
    return path if path.is_file() else None


def _microscope(known: dict[str, Any], shape: tuple[int, ...]) -> LightFieldMicroscope:
    """The microscope: napari-LF's lengths are in µm, its tube lens in mm, its wavelength in nm."""

    def length(key: str, unit: str = "um") -> str:
        return f"{float(known[key]):.12g} {unit}"

    focal_length, distance = length("ulens_focal_length"), known.get("ulens_focal_distance")
    per_pixel = float(known["pixel_size"]) / float(known["ulens_pitch"])
    return LightFieldMicroscope(
        wavelength=length("center_wavelength", "nm"),
        objective={
            "magnification": float(known["objective_magnification"]),
            "numerical_aperture": float(known["objective_na"]),
            "immersion_index": float(known["medium_index"]),
            "tube_lens": length("tubelens_focal_length", "mm"),
        },
        lenslets={
            "pitch": length("ulens_pitch"),
            "focal_length": focal_length,
            "count": tuple(math.ceil(n * per_pixel) for n in shape[:2]),
        },
        sensor={"pixel_pitch": length("pixel_size"), "shape": tuple(shape[:2])},
        sensor_distance=None if distance in (None, known["ulens_focal_length"]) else f"{distance:.12g} um",
    )
