"""From a raw image to one that is ready: calibration, white and dark image, camera file, colours."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.errors import CalibrationError, FormatError, SamplingWarning

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.raw import RawImage

FOCUSED, PLENOPTIC = "focused-plenoptic", "plenoptic"


@Parameter(name="*")
@dataclass(frozen=True)
class Origin:
    """What a raw image needs to become views or a picture.

    Parameters
    ----------
    calibration
        File made by 'lumigraph calibrate', or by the camera's maker (.xml, .ini), for a raw image.
    white
        White image, for a raw image: it is divided by it, and calibrated from it without --calibration.
    dark
        Image with the lens covered: subtracted with --white; tells which pixels are hot.
    camera
        Camera file, or a name of the catalogue: gives the calibration if no other is given, and depths.
    """

    calibration: Path | None = None
    white: Path | None = None
    dark: Path | None = None
    camera: str | None = None

    @property
    def is_given(self) -> bool:
        """Whether there is anything that only a raw image needs."""
        return self.calibration is not None or self.white is not None or self.dark is not None

    def described(self, kind: str | None = None) -> Any:
        """The camera, or None; refused if it is of another kind than the verb is for."""
        if self.camera is None:
            return None
        from lumigraph.instruments import load_camera

        camera: Any = load_camera(self.camera)
        if not hasattr(camera, "lenslets"):
            raise FormatError(
                f"--camera {self.camera} is a {camera.KIND}, which has no lenslets: "
                "use 'lumigraph deconvolve'."
            )
        if kind == FOCUSED != camera.KIND:
            raise FormatError(
                f"--camera {self.camera} is a {camera.KIND}, which is decoded: use 'lumigraph decode'."
            )
        if kind == PLENOPTIC and camera.KIND == FOCUSED:
            raise FormatError(
                f"--camera {self.camera} is a {camera.KIND}, which is rendered: use 'lumigraph render'."
            )
        return camera

    def prepared(
        self, raw: "RawImage", *, kind: str | None = None, devignette: bool | None = None
    ) -> "tuple[RawImage, Calibration]":
        """The raw image, devignetted and in colour, and its calibration; refused where they do not fit."""
        from lumigraph import calibration as verbs
        from lumigraph import sensor
        from lumigraph.core.drift import check_drift, vouch

        camera = self.described(kind)
        if camera is None and self.calibration is None and self.white is None:
            raise CalibrationError(
                "where the micro-images stand is not known. Give --calibration FILE or --white FILE."
            )
        if devignette and self.white is None:
            raise CalibrationError("--devignette needs the white image. Give --white FILE.")
        white = None if self.white is None else files.read_raw(self.white)
        dark = None if self.dark is None else files.read_raw(self.dark)
        if self.calibration is not None:
            found = files.read_calibration(self.calibration, raw.shape)
            if self.calibration.suffix.lower() != ".toml":
                found = _aligned(found, raw)
        elif white is not None:
            found = verbs.calibrate(white)
        else:
            assert camera is not None  # one of the three is given
            found = camera.calibration
        found.check_fits(raw.shape)
        check_drift(raw.data, found)
        if white is not None and devignette is not False:
            raw = verbs.devignette(raw, white, dark=dark)
        if camera is not None:
            found = _with_lengths(found, camera)
        ready = raw if raw.bayer is None else sensor.demosaic(raw)
        vouch(ready.data, found)
        return ready, found


NO_ORIGIN = Origin()


def _aligned(calibration: "Calibration", raw: "RawImage") -> "Calibration":
    """A maker's calibration, moved to the micro-images of the raw image where they show; told if so."""
    import warnings

    from lumigraph.calibration import aligned

    found = aligned(calibration, raw)
    if found is not calibration:
        warnings.warn(f"the maker's lattice was {found.notes[-1]}", SamplingWarning, stacklevel=2)
    return found


def _with_lengths(calibration: "Calibration", camera: Any) -> "Calibration":
    """The calibration with the lengths of a camera where it has none; a microscope has no separation."""
    pairs = (
        ("pixel_pitch", camera.sensor.pixel_pitch),
        ("separation", getattr(camera, "separation", None)),
        ("lenslet_distance", camera.lenslet_distance),
    )
    missing = {name: value for name, value in pairs if getattr(calibration, name) is None}
    return replace(calibration, **missing) if missing else calibration
