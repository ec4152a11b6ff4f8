"""The raw image and what belongs to it, read once."""

from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path

from lumigraph import io
from lumigraph.calibration import aligned, calibrate
from lumigraph.core import checks
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.raw import RawImage
from lumigraph.core.short_repr import called
from lumigraph.deconvolution.checkpoint import fingerprint
from lumigraph.errors import FormatError
from lumigraph.instruments import Instrument, load_camera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.preparation import prepare, read_calibration, sharp_kinds
from lumigraph.preparation.given import read_raw
from lumigraph.processing.napari_lf import FILE, settings_beside
from lumigraph.processing.recognise import Guess

Source = str | PathLike[str] | RawImage | Array
"""A file, or the raw image in it."""

_BESIDE = (".xml", ".ini")
"""Endings of makers' calibrations, which often lie beside the raw image under its name."""


@dataclass(frozen=True)
class Inputs:
    """A raw image or views, and what is known of the camera.

    Parameters
    ----------
    name
        The file's name, or "raw image".
    found
        Raw image as it was read, or views.
    white, dark
        Images with even light and without light.
    camera
        Its description.
    maker
        File of the calibration that is given, or lies beside the raw image.
    guesses
        What was not given but found.
    """

    name: str
    found: RawImage | LightField
    white: RawImage | None
    dark: RawImage | None
    camera: Instrument | None
    maker: Path | None
    guesses: tuple[Guess, ...] = ()

    @property
    def raw(self) -> RawImage:
        """The raw image.

        Raises
        ------
        FormatError
            Views.
        """
        if not isinstance(self.found, RawImage):
            raise FormatError(f"{self.name} holds views, not a raw image.")
        return self.found

    @cached_property
    def fingerprint(self) -> str:
        """Digest of everything that the results follow from."""
        maker = b"" if self.maker is None else self.maker.read_bytes()
        return fingerprint(self.found, self.white, self.dark, self._camera, maker)

    @property
    def lattice_fingerprint(self) -> str:
        """Digest of what the calibration follows from."""
        maker = b"" if self.maker is None else self.maker.read_bytes()
        seen = self.found if self.white is None else (self.white, self.raw.shape)
        return fingerprint(seen, self._camera, maker)

    @property
    def _camera(self) -> str:
        return "" if self.camera is None else self.camera.to_toml()

    def lattice_source(self) -> Guess:
        """Source of the lattice, with the reason for it."""
        if self.white is not None:
            return Guess("lattice", "from the white image", "that shows each micro-image by itself")
        if self.maker is not None:
            return Guess("lattice", f"from {self.maker.name}", "there is no white image")
        if self.camera is not None and self.camera.calibration is not None:
            return Guess(
                "lattice", "from the camera file", "there is neither a white image nor a calibration"
            )
        return Guess(
            "lattice", "from the raw image alone",
            "there is no white image: give --white for a better one, and for even brightness",
        )  # fmt: skip

    def calibration(self) -> Calibration:
        """Lattice of the micro-images, with lengths where they are known.

        Raises
        ------
        CalibrationError
            No lattice can be seen.
        """
        known = None if self.maker is None else read_calibration(self.maker, self.raw.shape)
        if self.white is not None:
            return _with_lengths(calibrate(self.white), known)
        if known is not None:
            return aligned(known, self.raw) if known.by_maker else known
        if self.camera is not None and self.camera.calibration is not None:
            return self.camera.calibration
        return calibrate(self.raw)

    def prepared(self, calibration: Calibration, *, divide: bool = True) -> PreparedImage:
        """The raw image, ready to use; `divide` as in `lumigraph.prepare`."""
        camera = self.camera if self.camera is not None and self.camera.calibration is not None else None
        return prepare(
            self.raw, calibration, white=self.white, dark=self.dark, camera=camera, divide=divide
        )  # fmt: skip

    def sharp(self, calibration: Calibration) -> list[float] | None:
        """Patch [px] at which each of three kinds of lenslets is sharp; None where unknown."""
        patches = self.camera.patches_on_raw() if isinstance(self.camera, Rendered) else ()
        return sharp_kinds(calibration, patches, self.maker)


def read(
    raw: Source | LightField,
    *,
    white: Source | None = None,
    dark: Source | None = None,
    camera: str | PathLike[str] | Instrument | None = None,
    calibration: str | PathLike[str] | None = None,
) -> Inputs:
    """Everything that is given, and a maker's calibration that lies beside the raw image under its name.

    Raises
    ------
    FormatError
        A file that is missing or holds something else.
    """
    path = Path(raw) if isinstance(raw, str | PathLike) else None
    found = raw if path is None else io.open(path)
    if not isinstance(found, RawImage | LightField):
        if path is not None:
            raise FormatError(f"{path} holds a {called(found)} where a raw image or views are needed.")
        found = RawImage(found)  # type: ignore[arg-type] - checked by RawImage
    checks.finite_array("raw image" if path is None else str(path), found.data, FormatError)
    described = camera if camera is None or isinstance(camera, Instrument) else load_camera(camera)
    maker = None if calibration is None else Path(calibration)
    known = Inputs(
        "raw image" if path is None else path.name, found, _image(white, "white image"),
        _image(dark, "dark image"), described, maker,
    )  # fmt: skip
    if path is None or isinstance(found, LightField):
        return known
    known = _as_set_up(known, path)
    if maker is not None:
        return known
    beside = next((p for ending in _BESIDE if (p := path.with_suffix(ending)).is_file()), None)
    if beside is None:
        return known
    about = Guess("calibration", f"read from {beside.name}", "it lies beside the raw image under its name")
    return replace(known, maker=beside, guesses=(*known.guesses, about))


def _as_set_up(known: Inputs, path: Path) -> Inputs:
    """The inputs with what napari-LF's settings beside the raw image say and nobody gave."""
    found = None if known.camera is not None else settings_beside(path, known.raw.shape)
    if found is None:
        return known
    guesses = [Guess("camera", found.camera.noun, f"{FILE} of napari-LF beside {path.name} describes it")]
    images = {"white": known.white, "dark": known.dark}
    for what, image in images.items():
        beside = getattr(found, what)
        if image is None and beside is not None:
            images[what] = _image(beside, f"{what} image")
            guesses.append(Guess(f"{what} image", beside.name, f"{FILE} names it"))
    return replace(known, camera=found.camera, guesses=(*known.guesses, *guesses), **images)


def _image(source: Source | None, what: str) -> RawImage | None:
    if source is None or isinstance(source, RawImage):
        return source
    return read_raw(Path(source), what) if isinstance(source, str | PathLike) else RawImage(source)


def _with_lengths(found: Calibration, known: Calibration | None) -> Calibration:
    """The calibration with the lengths of another one where it has none."""
    if known is None:
        return found
    names = ("pixel_pitch", "separation", "lenslet_distance")
    missing = {name: getattr(known, name) for name in names if getattr(found, name) is None}
    return replace(found, **missing)
