"""A file, or a raw image with its calibration, as an exhibit."""

import tomllib
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lumigraph import io
from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.progress import Progress, Stage, silent, within
from lumigraph.core.raw import RawImage
from lumigraph.core.saturation import with_bits
from lumigraph.core.short_repr import called
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError, SamplingWarning
from lumigraph.instruments.capabilities import Decoded, Rendered, WithDepth, WithMainLens, WithObjective
from lumigraph.preparation import prepare, sharp_kinds
from lumigraph.preparation.agreement import Described
from lumigraph.preparation.given import Given, read_pages
from lumigraph.viewer.exhibit import Exhibit, Planes, comfortable, depth_of, depth_of_pixels

if TYPE_CHECKING:
    from lumigraph.instruments.loading import AnyCamera
    from lumigraph.samples.portrait import PortraitSample

_CAMERA_FILE = 1 << 20  # bytes; camera files have some hundred
_PATCHES = 25
_SIMULATED_PATCHES, _PER_LOBE = 13, 3.0  # pictures of a camera that is simulated; samples in λb/d
_MANY_DIRECTIONS = 10  # of a microscope, whose simulation by waves takes minutes
_PATCH_SPAN = 1.8  # 2.0 pictures from tiles so many times smaller to so many times larger
_LABELS = {
    "alpha": ("Focus α′", ""),
    "dz [m]": ("Depth", "m"),
    "lambda": ("Focus λ", ""),
    "page": ("Page", ""),
}


@dataclass(frozen=True)
class PatchRange:
    """Pictures of a camera 2.0, each from patches of one size.

    Parameters
    ----------
    sizes
        Of the patches [px], ascending.
    samples
        Of the pictures for each lenslet; the largest size to the nearest whole number where None.
    """

    sizes: tuple[float, ...]
    samples: int | None = None

    @classmethod
    def about(cls, patch: float, calibration: Calibration) -> "PatchRange":
        """Range from some times smaller to some times larger than one patch size."""
        checks.finite("patch", patch, "px")
        most = 0.98 * calibration.lattice.pitch
        sizes = np.linspace(abs(patch) / _PATCH_SPAN, min(abs(patch) * _PATCH_SPAN, most), _PATCHES)
        return cls(tuple(np.unique(np.copysign(sizes, patch)).tolist()))

    @classmethod
    def of(cls, camera: Rendered, seen: "PortraitSample") -> "PatchRange":
        """Range over all depths of a scene, as finely as diffraction at the lenslets leaves it."""
        first, last = (camera.patch_at(dz) for dz in seen.depths)
        sizes = np.unique(np.linspace(first, last, _SIMULATED_PATCHES))
        largest = float(np.abs(sizes).max())
        return cls(tuple(sizes.tolist()), max(1, round(min(largest, _PER_LOBE * largest / seen.lobe))))


@dataclass(frozen=True)
class Origin(Given):
    """Files and values that turn a raw image into views or pictures.

    Parameters
    ----------
    calibration, white, dark
        Files.
    camera
        Its description.
    patch
        Of a camera 2.0 [px]: pictures with patches about this size.
    page
        Of a stack of raw images, counted from 0.
    bit_depth
        Of a raw image whose file does not say.
    mosaic
        Views (v, u) of a picture of blocks, one for each lenslet.
    """

    camera: Described | None = None
    patch: float | None = None
    page: int | None = None
    bit_depth: int | None = None
    mosaic: tuple[int, int] | None = None

    @property
    def is_known(self) -> bool:
        """True if the places of the micro-images are known."""
        return any(one is not None for one in (self.camera, self.calibration, self.white))


def open_exhibit(path: Path, origin: Origin | None = None, progress: Progress | None = None) -> Exhibit:
    """Exhibit of a file, a folder of views or a camera's description.

    Parameters
    ----------
    path
        Anything `lumigraph.open` reads, a camera file (TOML) or the name of a bundled camera.
    origin
        Calibration or white image of a raw image.
    progress
        Called as ``progress(fraction)``, a `core.progress.Stage`.

    Raises
    ------
    FormatError
        Nothing there, or something that has no picture, such as a calibration.
    LumigraphError
        Whatever reading, decoding or simulating finds wrong.
    """
    tell = progress or silent
    if is_camera(path):
        return _simulated(path, tell)
    tell(Stage(0.0, "reading"))
    mosaic = origin.mosaic if origin is not None else None
    one = origin.page if origin is not None and mosaic is None and io.opens_pages(path) else None
    found = io.open(path, page=one, views=mosaic)
    if mosaic is not None and origin is not None:
        origin = replace(origin, mosaic=None)
    if origin is not None and one is not None and not isinstance(found, RawImage):
        origin = replace(origin, page=None)
    if origin is not None and (
        origin.page is not None or (isinstance(found, Stack | Volume) and origin.is_known)
    ):
        (found,) = read_pages(path, None if origin.page is None else str(origin.page), one=True).values()
    if isinstance(found, DepthMap):
        found = RawImage(found.values)
    if isinstance(found, RawImage):
        found = with_bits(found, None if origin is None else origin.bit_depth)
        return _raw(path.name, found, origin or Origin(), tell)
    if origin not in (None, Origin()):
        raise FormatError(
            f"{path} holds no raw image, so that --calibration, --white, --dark, --camera and --patch have "
            "no use."
        )
    match found:
        case LightField():
            return of_views(path.name, found)
        case Stack():
            return of_stack(path.name, found)
        case Volume():
            return of_volume(path.name, found)
    raise FormatError(f"{path} holds a {called(found)}, of which there is no picture.")


def of_views(name: str, views: LightField) -> Exhibit:
    """A light field, with depth on demand."""
    checks.finite_array(name, views.data, FormatError)
    views, relative = comfortable(views)
    return Exhibit(
        name, views=views, depth=depth_of(views), facts=_about_views(views), relative=relative
    )  # fmt: skip


def of_stack(name: str, stack: Stack) -> Exhibit:
    """A stack of pictures, in ascending order of their positions."""
    checks.finite_array(name, stack.data, FormatError)
    positions = np.asarray(stack.positions or range(1, len(stack) + 1), float)
    order = np.argsort(positions, kind="stable")
    label, unit = _LABELS.get(stack.quantity, (stack.quantity, ""))
    planes = Planes(to_numpy(stack.data)[order], tuple(positions[order].tolist()), label, unit)
    facts = (("Pictures", f"{len(stack)} of {_size(stack.shape)}"), ("Numbers", _numbers(stack.data)))
    return Exhibit(name, planes=planes, facts=facts)


def of_volume(name: str, volume: Volume) -> Exhibit:
    """Planes of space."""
    checks.finite_array(name, volume.data, FormatError)
    dz, dy, dx = (f"{step * 1e6:.4g} µm" for step in volume.spacing)
    facts = (
        ("Volume", " × ".join(map(str, volume.shape)) + " (z, y, x)"), ("Steps", f"{dz}, {dy}, {dx}"),
        ("Numbers", _numbers(volume.data)),
    )  # fmt: skip
    return Exhibit(name, volume=volume, facts=facts)


def of_raw(
    name: str,
    raw: RawImage,
    calibration: Calibration | None = None,
    patch: float | PatchRange | None = None,
    origin: Origin = Origin(),
) -> Exhibit:
    """A raw image; with a calibration also its views, or (camera 2.0) pictures with patches about `patch`."""
    checks.finite_array(name, raw.data, FormatError)
    if calibration is not None and not isinstance(raw, PreparedImage):
        raw = prepare(raw, calibration)
    facts = (
        ("Raw image", f"{_size(raw.shape)}" + (f", Bayer {raw.bayer}" if raw.bayer else "")),
        ("Numbers", _numbers(raw.data)),
        *((("Pixels", f"{raw.pixel_pitch * 1e6:.4g} µm"),) if raw.pixel_pitch else ()),
        *(tuple(_split(line) for line in calibration.report().splitlines()) if calibration else ()),
        *((("Prepared", note) for note in raw.notes) if isinstance(raw, PreparedImage) else ()),
    )  # fmt: skip
    if calibration is None:
        return Exhibit(name, raw=raw, facts=facts)
    patch = patch if patch is not None else _own_patch(raw, calibration)
    if patch is not None:
        camera = origin.camera
        camera = camera if isinstance(camera, Rendered) and isinstance(camera, WithDepth) else None
        sizes = () if camera is None else camera.patches_on_raw()
        focus = sharp_kinds(calibration, sizes, origin.calibration)
        planes = rendered(raw, calibration, patch, focus)
        return Exhibit(
            name, raw=raw, calibration=calibration, planes=planes, facts=facts,
            depth=lambda: depth_of_pixels(raw, calibration, focus, camera),
            measure=("Patch", "px") if camera is None else ("Depth", "m"),
        )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # of cameras 2.0, which have been looked for
        decoded = _decoded(raw, calibration, origin.camera)
    views, relative = comfortable(decoded)
    return Exhibit(
        name, views=views, raw=raw, calibration=calibration, depth=depth_of(views),
        facts=(*facts, *_about_views(views)), relative=relative, metres=_metres(origin.camera, decoded),
    )  # fmt: skip


def _decoded(raw: RawImage, calibration: Calibration, camera: Described | None) -> LightField:
    """Views of a raw image; each micro-image is one where the lenslets stand in the pupil."""
    from lumigraph.rendering import decode

    views = decode(raw, calibration)
    if not (isinstance(camera, WithObjective) and camera.in_pupil):
        return views
    data = np.moveaxis(to_numpy(views.data), (2, 3), (0, 1))[:, :, ::-1, ::-1]
    valid = (
        None if views.valid is None else np.moveaxis(to_numpy(views.valid), (2, 3), (0, 1))[:, :, ::-1, ::-1]
    )
    return LightField(data, Grid(data.shape[:2], (1.0, 1.0)), Grid(data.shape[2:4], (1.0, 1.0)), 1.0, valid)


def _metres(camera: Described | None, views: LightField) -> Callable[[np.ndarray], np.ndarray] | None:
    """Depths from the focused plane [m] of disparities, as `lumigraph depth` has them; None if unknown."""
    from lumigraph.depth import defocus

    def disparities(values: np.ndarray) -> DepthMap:
        return DepthMap(values, np.ones(values.shape), "disparity")

    if isinstance(camera, WithObjective) and not camera.in_pupil:
        return lambda values: to_numpy(defocus(disparities(values), views, camera.depth_per_alpha).values)
    if isinstance(camera, Rendered) or not isinstance(camera, WithDepth):
        return None
    if views.separation <= camera.main_lens.focal_length:
        return None
    return lambda values: to_numpy(camera.in_metres(disparities(values), views).values)


def rendered(
    raw: RawImage, calibration: Calibration, patch: float | PatchRange, focus: list[float] | None = None
) -> Planes:
    """Pictures of a camera 2.0 with patches about one, or as given, as `lumigraph render --patches` has them.

    `focus`: patches [px] at which each of three kinds of lenslets is sharp, where they are known.
    """
    from lumigraph.rendering import render_stack

    range_ = patch if isinstance(patch, PatchRange) else PatchRange.about(patch, calibration)
    pictures = to_numpy(render_stack(raw, calibration, range_.sizes, samples=range_.samples, focus=focus))
    return Planes(pictures.astype(np.float32, copy=False), range_.sizes, "Patch", "px")


def is_camera(path: Path) -> bool:
    """True if a path is a camera's description, or names a bundled camera."""
    if not path.exists():
        from lumigraph.instruments import catalogue

        return len(path.parts) == 1 and str(path) in catalogue()
    if path.suffix.lower() != ".toml" or not path.is_file() or path.stat().st_size > _CAMERA_FILE:
        return False
    try:
        return tomllib.loads(path.read_text("utf-8")).get("kind") not in (None, "calibration")
    except (ValueError, OSError):
        return False  # `lumigraph.open` says what is wrong


def _simulated(path: Path, tell: Progress) -> Exhibit:
    """Exhibit of a camera before the painted scene, whose layers lie at several depths."""
    from lumigraph import samples
    from lumigraph.instruments import load_camera
    from lumigraph.simulation import Incoherent, simulate

    camera = load_camera(path)
    report = within(tell, 0.0, 0.4, "simulating")
    if isinstance(camera, Decoded | Rendered) and isinstance(camera, WithMainLens):
        found = samples.portrait(camera, progress=report)
        tell(Stage(0.4, "rendering"))
        raw = prepare(found.raw, camera.calibration, white=found.white)
        patches = PatchRange.of(camera, found) if isinstance(camera, Rendered) else None
        facts = (("Simulated", "by rays and the lenses' diffraction, without noise"),)
    else:
        scene, used = samples.glowing(camera.object_grid, depth_reach(camera)), _quick(camera)
        raw, patches = simulate(used, scene, Incoherent(1e-2), progress=report), None
        how = "by wave optics to 1 %" if used is camera else "by rays, without diffraction"
        facts = (("Simulated", f"{how}, without noise"),)
    exhibit = of_raw(path.name, raw, camera.calibration, patches, Origin(camera=camera))
    return replace(exhibit, facts=(*exhibit.facts, *facts))


def _quick(camera: "AnyCamera") -> "AnyCamera":
    """The camera, or one that rays describe where waves would take minutes."""
    known = {row.name: row.value for row in camera.quantities()}
    if "refocus range" not in known or known["directions per axis"] <= _MANY_DIRECTIONS:
        return camera
    return camera.replace(objective={"model": "rays"})


def depth_reach(camera: "AnyCamera") -> float:
    """Distance from the focused plane to the nearest and the farthest part of the scene [m]."""
    known = {row.name: row.value for row in camera.quantities()}
    if "refocus range" in known:
        return 0.4 * known["refocus range"]
    if isinstance(camera, WithMainLens):
        return 3 * known["depth of field"]
    # Of a Fourier microscope: the outermost views move by a twelfth of the field.
    return camera.object_grid.size[0] / 12 * known["immersion index"] / known["numerical aperture"]


def _raw(name: str, raw: RawImage, origin: Origin, tell: Progress) -> Exhibit:
    if not origin.is_known:
        return of_raw(name, raw)
    tell(Stage(0.3, "calibrating"))
    ready = origin.prepared(raw, camera=origin.camera)
    tell(Stage(0.6, "decoding"))
    return of_raw(name, ready, ready.calibration, origin.patch, origin)


def _own_patch(raw: RawImage, calibration: Calibration) -> float | None:
    """Patch of a camera 2.0 whose micro-images show the same sharp things; None of a camera 1.0."""
    from lumigraph.rendering.kind_check import focused_shift

    found = focused_shift(raw.data, calibration)
    if found is None and calibration.lattice.kinds > 1:
        return 0.3 * calibration.lattice.pitch  # lenslets of several kinds are those of a camera 2.0
    return found


def _about_views(views: LightField) -> tuple[tuple[str, str], ...]:
    nv, nu, nt, ns = views.data.shape[:4]
    colours = ", RGB" if len(views.data.shape) == 5 and views.data.shape[4] == 3 else ""
    return ("Views", f"{nv} × {nu} of {_size((nt, ns))}{colours}"), ("Numbers", _numbers(views.data))


def _size(shape: tuple[int, int]) -> str:
    return f"{shape[1]} × {shape[0]} px"


def _numbers(data: Any) -> str:
    return f"{data.dtype} {float(data.min()):.4g} … {float(data.max()):.4g}"


def _split(line: str) -> tuple[str, str]:
    word, _, rest = line.strip().partition(" ")
    return word.capitalize(), rest.strip()
