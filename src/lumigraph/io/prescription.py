"""Prescriptions of lenses, ZMX files and Optiland's JSON: read and ray traced by Optiland, an extra."""

import contextlib
import io
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.errors import FormatError, GeometryError, LumigraphError

MOST_BYTES = 2**22
"""A prescription has some tens of surfaces, a few KiB."""

SURFACES = ("Plane", "StandardGeometry", "EvenAsphere")
"""Optiland's names of surfaces that are round about the axis."""

_TYPES = ("STANDARD", "EVENASPH")
_SHAPES = ("SQAP", "SQOB", "ELAP", "ELOB", "SPID", "UDAP", "UDOB", "CLOB", "OBDC")
_VIGNETTING = ("VDXN", "VDYN", "VCXN", "VCYN", "VANN")
_VISIBLE = (0.38e-6, 0.75e-6)
"""Range in which a glass is known by its index and Abbe number [m]."""

_D_LINE = 587.5618e-9
"""Wavelength of the indices of a ZMX file [m]."""

_SAME_INDEX = 1e-3
"""Difference allowed between a glass's index and the file's: melts and catalogues differ by less."""

_MM, _UM = 1e-3, 1e-6

_DRAWN = 41
"""Places of a surface that is drawn."""


@dataclass(frozen=True, slots=True)
class FirstOrder:
    """First-order properties of a lens at a wavelength.

    Parameters
    ----------
    focal_length
        [m].
    front
        First surface to front principal plane, positive behind the surface [m].
    back
        Last surface to rear principal plane, positive behind the surface [m].
    exit_pupil
        Rear principal plane to exit pupil, positive behind [m].
    pupil_magnification
        Exit pupil's diameter over the entrance pupil's.
    widest
        Entrance pupil's diameter that the file has [m].
    """

    focal_length: float
    front: float
    back: float
    exit_pupil: float
    pupil_magnification: float
    widest: float


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Rays of some fields and pupil points at the image plane: arrays (fields, rays).

    Parameters
    ----------
    along, across
        Direction cosines along the field and across it.
    height, beside
        Places along the field and across it [m].
    path
        Optical path from the object point [m].
    """

    along: np.ndarray
    across: np.ndarray
    height: np.ndarray
    beside: np.ndarray
    path: np.ndarray


class Prescription:
    """A lens as its file has it. The file is read anew for each one: tracing changes what Optiland holds.

    Parameters
    ----------
    path
        Path of a ZMX file or of Optiland's JSON.

    Raises
    ------
    FormatError
        No such file, a file of another kind, or one that Optiland does not read.
    GeometryError
        What is not followed: mirrors, surfaces that are not round about the axis, several configurations.
    LumigraphError
        Optiland is not installed.
    """

    def __init__(self, path: Path) -> None:
        self.name, self.notes = path.name, tuple[str, ...]()
        if path.suffix.lower() == ".zmx":
            self.notes = _check_zmx(path)
        elif path.suffix.lower() != ".json":
            raise FormatError(f"{str(path)!r} is no prescription. Give a ZMX file or Optiland's JSON.")
        else:
            content(path)
        self._lens = _read(path)
        self._check()
        if path.suffix.lower() == ".zmx":
            self.notes += tuple(self._check_glasses(path))

    def _refuse(self, what: str, remedy: str) -> GeometryError:
        return GeometryError(f"{self.name!r} has {what}, which is not followed. {remedy}")

    def _check(self) -> None:
        """Refuse what would be traced as something that it is not."""
        lens = self._lens
        for number, surface in enumerate(lens.surfaces.surfaces):
            kind, place = type(surface.geometry).__name__, surface.geometry.cs
            if kind not in SURFACES:
                raise self._refuse(f"a {kind} at surface {number}", "Use spheres, conics and even aspheres.")
            if any(abs(float(at)) > 1e-12 for at in (place.x, place.y, place.rx, place.ry, place.rz)):
                raise self._refuse(f"a decentred or tilted surface {number}", "Use a centred lens.")
            model = surface.interaction_model
            if type(model).__name__ != "RefractiveReflectiveModel" or model.is_reflective:
                raise self._refuse(f"a mirror or no glass at surface {number}", "Use a lens of glasses.")
            if surface.aperture is not None and type(surface.aperture).__name__ != "RadialAperture":
                raise self._refuse(
                    f"a {type(surface.aperture).__name__} at surface {number}", "Use round apertures."
                )
            if getattr(surface.aperture, "r_min", 0):
                raise self._refuse(f"an annular aperture at surface {number}", "Use round apertures.")
        if len(lens.pickups) or len(lens.solves):  # they move surfaces whenever others are placed
            raise self._refuse("pickups or solves", "Save it without them: numbers stay as they are.")
        if not any(surface.is_stop for surface in lens.surfaces.surfaces):
            raise self._refuse("no stop", "Say which surface is the stop.")
        if lens.apodization is not None or lens.polarization != "ignore":
            raise self._refuse("an apodisation or a polarisation", "Leave it out.")
        if lens.fields.telecentric:
            raise self._refuse("a telecentric object space", "Use a lens with an entrance pupil.")

    def _check_glasses(self, path: Path) -> Iterator[str]:
        """Refuse glasses that are others of the same name; notes on those that are known by two numbers."""
        surfaces = self._lens.surfaces.surfaces
        for number, name, index in _glasses(path):
            material = surfaces[number].material_post
            found = float(np.ravel(material.n(_D_LINE / _UM))[0])
            if not abs(found - index) < _SAME_INDEX:
                raise self._refuse(
                    f"{name} of index {index:g} at surface {number}, for which Optiland takes {found:.5g}",
                    "Give the glass's catalogue (GCAT), or the glass by its index and Abbe number.",
                )
            if type(material).__name__.startswith("Abbe") and name != "___BLANK":
                yield f"{name} is in no catalogue: it is followed by its index and Abbe number"

    def wavelengths(self) -> tuple[float, float]:
        """Range of wavelengths in which the indices of all glasses are known [m]."""
        low, high = 0.0, math.inf
        for surface in self._lens.surfaces.surfaces:
            material = surface.material_post
            known = material.spectral_range("n")
            first, last = (known[0] * _UM, known[1] * _UM) if known else (0.0, math.inf)
            if type(material).__name__.startswith("Abbe"):
                first, last = max(first, _VISIBLE[0]), min(last, _VISIBLE[1])
            low, high = max(low, first), min(high, last)
        return low, high

    def first_order(self, wavelength: float) -> FirstOrder:
        """First-order properties at a wavelength [m].

        Raises
        ------
        GeometryError
            No focal length, or another medium than air before or behind it.
        """
        self._lens.wavelengths.wavelengths.clear()
        self._lens.wavelengths.add(value=wavelength / _UM, is_primary=True)
        surfaces, paraxial = self._lens.surfaces.surfaces, self._lens.paraxial
        for surface, where in ((surfaces[0], "before"), (surfaces[-2], "behind")):
            index = float(np.ravel(surface.material_post.n(wavelength / _UM))[0])
            if abs(index - 1) > 1e-3:
                raise self._refuse(f"a medium of index {index:.4g} {where} the lens", "Use a lens in air.")
        with self._tracing():
            numbers = {
                "focal_length": paraxial.f2(), "front": paraxial.P1(),
                "back": paraxial.P2() + self._last_gap(),
                "exit_pupil": paraxial.XPL() - paraxial.P2(), "widest": paraxial.EPD(),
            }  # fmt: skip
            ratio = float(np.ravel(paraxial.XPD() / paraxial.EPD())[0])
        found = {name: float(np.ravel(value)[0]) * _MM for name, value in numbers.items()}
        if not all(map(math.isfinite, (*found.values(), ratio))) or found["focal_length"] <= 0:
            raise GeometryError(
                f"{self.name!r} has a focal length of {found['focal_length'] * 1e3:.6g} mm and a pupil "
                f"{found['widest'] * 1e3:.6g} mm wide. Give a lens that forms a real image."
            )
        return FirstOrder(pupil_magnification=abs(ratio), **found)

    def _last_gap(self) -> float:
        positions = np.ravel(self._lens.surfaces.positions)
        return float(positions[-1] - positions[-2])

    def focus(self, object_distance: float, image_distance: float, diameter: float) -> None:
        """Place object and image planes, from the principal planes, and stop the entrance pupil down [m]."""
        first, count = self._lens.paraxial, len(self._lens.surfaces.surfaces)
        with self._tracing():
            front, back = (float(np.ravel(at)[0]) for at in (first.P1(), first.P2() + self._last_gap()))
            gaps = object_distance / _MM - front, back + image_distance / _MM
            for gap, where in zip(gaps, ("object", "image"), strict=True):
                if gap <= 0:
                    raise GeometryError(
                        f"the {where} plane would lie {-gap:.4g} mm inside {self.name!r}. "
                        "Use another object_distance."
                    )
            self._lens.updater.set_thickness(gaps[0], 0)
            self._lens.updater.set_thickness(gaps[1], count - 2)
            self._lens.set_aperture("EPD", diameter / _MM)
            self._lens.ray_tracer.set_aiming("iterative")

    def trace(self, wavelength: float, heights: np.ndarray, pupil: np.ndarray) -> Rays:
        """Rays from object points at some heights [m] through points (n, 2) of the stop, along and across it.

        Rays that miss a surface or end at an aperture are not finite.
        """
        farthest = max(float(np.max(np.abs(heights))), 1e-9)
        lens = self._lens
        lens.fields.fields.clear()
        lens.fields.set_type("object_height")
        for height in (0.0, farthest):
            lens.fields.add(y=height / _MM)
        field = np.repeat(heights / farthest, len(pupil))
        along, across = (np.tile(pupil[:, k], len(heights)) for k in (0, 1))
        with self._tracing():
            rays = lens.trace_generic(np.zeros_like(field), field, across, along, wavelength / _UM)
        passed = np.where(np.asarray(rays.i) > 0, 1.0, np.nan)
        found = (
            np.asarray(each, float) * passed * scale
            for each, scale in ((rays.M, 1), (rays.L, 1), (rays.y, _MM), (rays.x, _MM), (rays.opd, _MM))
        )
        return Rays(*(each.reshape(len(heights), len(pupil)) for each in found))

    def drawn(self, wavelength: float, heights: np.ndarray, pupil: np.ndarray) -> dict[str, np.ndarray]:
        """Arrays for a drawing: rays as those of `trace`, in the plane of the field, and surfaces [m].

        `rays` (rays, 2, n + 2), z and height at object, surfaces and image; `surfaces` (n, 2, points), z and
        height as far as the rays reach; `is_glass` (n,), behind each of them; `stop`, the number of one.
        """
        self.trace(wavelength, heights, np.stack([pupil, np.zeros_like(pupil)], axis=-1))
        found = self._lens.surfaces
        rays = np.stack([np.asarray(each, float) for each in (found.z, found.y)]).transpose(2, 0, 1) * _MM
        inner, profiles = found.surfaces[1:-1], []
        for surface, place, half in zip(
            inner, np.ravel(found.positions)[1:-1], np.abs(rays[:, 1, 1:-1]).max(axis=0), strict=True
        ):
            at = np.linspace(-half, half, _DRAWN)
            sag = np.ravel(surface.geometry.sag(np.zeros(_DRAWN), at / _MM))
            profiles.append([(float(place) + sag) * _MM, at])
        indices = [float(np.ravel(surface.material_post.n(wavelength / _UM))[0]) for surface in inner]
        return {
            "rays": rays, "surfaces": np.array(profiles), "is_glass": np.array(indices) > 1 + 1e-3,
            "stop": np.flatnonzero([surface.is_stop for surface in inner]),
        }  # fmt: skip

    @contextlib.contextmanager
    def _tracing(self) -> Iterator[None]:
        with _quiet():
            try:
                yield
            except LumigraphError:
                raise
            except Exception as error:  # whatever goes wrong inside is one line
                told = str(error).splitlines()[0][:200] if str(error) else ""
                raise GeometryError(
                    f"Optiland cannot trace {self.name!r}: {type(error).__name__}: {told}. "
                    "Use a smaller field or diameter."
                ) from None


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Neither Optiland's warnings nor what it prints."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def _read(path: Path) -> Any:
    with _quiet():
        try:
            from optiland import fileio  # pyright: ignore[reportMissingImports] - an extra
        except ImportError:
            raise LumigraphError(
                "a prescription is ray traced by Optiland. Install it: pip install 'lumigraph[optiland]'."
            ) from None
        try:
            if path.suffix.lower() == ".zmx":
                return fileio.load_zemax_file(str(path))
            return fileio.load_optiland_file(str(path))
        except Exception as error:  # of its readers, anything
            told = str(error).splitlines()[0][:200] if str(error) else ""
            raise FormatError(
                f"Optiland cannot read {str(path)!r}: {type(error).__name__}: {told}. Check the file."
            ) from None


def content(path: Path) -> bytes:
    """Content of a file of a reasonable size.

    Raises
    ------
    FormatError
        No such file, or one that is too large.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise FormatError(
            f"{str(path)!r} cannot be read: {error.strerror}. Check its name and folder."
        ) from None
    if len(content) > MOST_BYTES:
        raise FormatError(f"{str(path)!r} is larger than {MOST_BYTES >> 20} MiB, too large for a lens.")
    return content


def _text(content: bytes) -> str:
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8"
    return content.decode(encoding, errors="replace")


def _check_zmx(path: Path) -> tuple[str, ...]:
    """Refuse what Optiland's reader passes over; notes on what makes no difference to be refused."""
    name, notes, surface = path.name, [], -1
    for line in _text(content(path)).splitlines():
        word, *rest = line.split() or [""]
        surface += word == "SURF"
        if word == "UNIT" and rest and rest[0] != "MM":
            raise FormatError(f"{name!r} is in {rest[0]}. Save it in mm.")
        if word == "MNUM" and rest and rest[0] != "1":
            raise _not_followed(name, f"{rest[0]} configurations", "Save the one that you want.")
        if word == "TYPE" and rest and rest[0] not in _TYPES:
            raise _not_followed(
                name, f"a surface {surface} of type {rest[0]}", "Use spheres, conics and even aspheres."
            )
        if word == "GLAS" and rest and rest[0].upper() == "MIRROR":
            raise _not_followed(name, f"a mirror at surface {surface}", "Use a lens of glasses.")
        if word in _SHAPES and (word != "OBDC" or any(map(_is_number, rest))):
            raise _not_followed(name, f"{word} at surface {surface}", "Use round, centred apertures.")
        if word in _VIGNETTING and any(map(_is_number, rest)):
            notes.append("vignetting factors of the file are not used: apertures of surfaces are")
    return tuple(dict.fromkeys(notes))


def _glasses(path: Path) -> Iterator[tuple[int, str, float]]:
    """Surface, name and index of the glasses of a ZMX file that say their index."""
    surface = -1
    for line in _text(content(path)).splitlines():
        word, *rest = line.split() or [""]
        surface += word == "SURF"
        if word == "GLAS" and len(rest) > 3 and _is_number(rest[3]) and float(rest[3]) > 1:
            yield surface, rest[0], float(rest[3])


def _not_followed(name: str, what: str, remedy: str) -> GeometryError:
    return GeometryError(f"{name!r} has {what}, which is not followed. {remedy}")


def _is_number(word: str) -> bool:
    """True for a number that is not 0."""
    try:
        return float(word) != 0
    except ValueError:
        return False
