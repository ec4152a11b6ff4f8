"""Scenes that a renderer traces, as layers before a camera: opaque slices with what the whole main lens sees.

The scene is rendered from points of the main lens. What they see is sorted by its distance into slices;
behind each slice the farther ones go on as far as some point of the lens sees them, in the colours that it
sees there. Mitsuba 3 traces the rays (``pip install 'lumigraph[scenes]'``).
"""

import math
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

from lumigraph.core import checks, memory
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress, silent
from lumigraph.errors import FormatError, GeometryError, LumigraphError, SamplingError, SamplingWarning
from lumigraph.scene.rgbd import BESIDE, MOST, SeeingCamera
from lumigraph.scene.volumes import Scene, Slice

FINER = 2
"""Rays' pixels along each axis of a sample, so that edges have parts of samples."""

MORE = 8
"""Times as many rays for the first view, the middle one, whose light is the truth."""

GLOSSY = 0.01
"""Change of surfaces' light over the main lens, relative rms, from which a warning says it."""

LEFT_OPEN = 1e-3
"""Part of the picture's light that may come from nowhere."""

ALIKE = 2e-3
"""Relative difference of the distances of what is the same place in two views."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)

TO_SCENE = np.diag([-1.0, -1.0, 1.0, 1.0])
"""Turn (4, 4) of axes as a camera sees (x right, y down, z away) to a renderer's sensor (x left, y up)."""


@dataclass(frozen=True, slots=True, eq=False)
class RaytracedScene:
    """Layers of a rendered scene, and its truth as the middle of the main lens sees it.

    Parameters
    ----------
    scene
        Opaque slices, for `simulate`.
    grid
        Samples of the truth in the focused plane [m].
    radiance
        All in focus (y, x) or (y, x, 3).
    depth
        (y, x), from the focused plane [m], positive farther; NaN where nothing is.
    normals
        (y, x, 3) as (y, x, z) of the surfaces, z away from the camera; 0 where nothing is.
    visibility
        (y, x), part of the main lens that sees each place, 0 to 1.
    glossy
        Change of surfaces' light over the main lens, which slices do not have: relative rms.
    noise
        Of the slices' light, from the number of rays: relative rms.
    """

    scene: Scene
    grid: Grid
    radiance: np.ndarray
    depth: np.ndarray
    normals: np.ndarray
    visibility: np.ndarray
    glossy: float
    noise: float


@dataclass(frozen=True, slots=True, eq=False)
class LensView:
    """Picture that a point of the main lens sees of the scene, at pixels of the focused plane.

    Parameters
    ----------
    place
        The point (y, x) on the lens [m].
    light
        Radiance (ny, nx, 3).
    distance
        From the main lens along the axis (ny, nx) [m]; infinite where nothing is.
    normals
        (ny, nx, 3) as (y, x, z).
    """

    place: tuple[float, float]
    light: np.ndarray
    distance: np.ndarray
    normals: np.ndarray


def mitsuba(
    source: str | os.PathLike[str] | Mapping[str, Any],
    camera: SeeingCamera,
    grid: Grid | None = None,
    planes: int = 16,
    *,
    across: int = 5,
    samples: int = 4,
    colour: bool = False,
    pose: Any = None,
    seed: int = 0,
    progress: Progress = silent,
) -> RaytracedScene:
    """Scene of the renderer Mitsuba 3 before a camera, as opaque slices for wave optics, with its truth.

    Its lengths are metres. The main lens stands where the scene's own sensor does, and looks the same way;
    without a sensor it stands at the origin and looks along z, y downwards.

    Parameters
    ----------
    source
        Scene file (.xml), or a scene's description as `mitsuba.load_dict` takes it.
    camera
        Camera whose focused plane and main lens the scene is rendered for.
    grid
        Samples of the field in the focused plane; by default the camera's, at most 1024 along an axis.
    planes
        Slices at even steps of 1/z, 1 to 64; those that are empty are left out.
    across
        Points along the main lens' diameter that the scene is rendered from, 3 or more, odd.
    samples
        Rays for each sample and each of those points.
    colour
        Whether slices have three colours, or their luminance.
    pose
        (4, 4) matrix of the main lens in the scene, as a sensor's `to_world`.
    seed
        Of the rays.
    progress
        Shows how far the rendering is.

    Warns
    -----
    SamplingWarning
        Surfaces whose light changes by more than 1 % rms over the main lens, which slices cannot show.

    Raises
    ------
    FormatError
        A file that Mitsuba cannot read.
    GeometryError
        Things nearer than the main lens; light from nowhere, since slices need a distance.
    LumigraphError
        No Mitsuba.
    SamplingError
        More samples than memory holds.

    Examples
    --------
    >>> room = mitsuba({"type": "scene", "wall": {"type": "rectangle"}}, camera)  # doctest: +SKIP
    """
    planes = checks.whole("planes", planes, 1)
    if planes > MOST:
        raise GeometryError(f"planes is {planes} but must be at most {MOST}.")
    across, samples = checks.whole("across", across, 3), checks.whole("samples", samples, FINER**2)
    if across % 2 == 0:
        raise GeometryError(f"across is {across} but must be odd: one view is of the lens' middle.")
    if grid is None:
        grid = _field(camera)
    needed = 4.0 * math.prod(grid.shape) * (FINER**2 * 16 + planes * (FINER**2 * 2 + 8))
    memory.require(needed, f"a scene of {grid.shape} samples", "Use a coarser grid.", SamplingError)
    tracer = Tracer.of(source, pose)
    places = lens_places(camera.pupil_diameter, across)
    layers: Layers | None = None
    views = tracer.views(grid, camera.object_distance, places, samples, seed)
    for k, view in enumerate(views):
        if layers is None:  # the middle view comes first
            layers = Layers.of(view, grid, camera, planes)
        layers.add(view)
        progress((k + 1) / len(places))
    assert layers is not None
    return layers.finished(colour)


def lens_places(diameter: float, across: int) -> list[tuple[float, float]]:
    """Points (y, x) of a square lattice over a round main lens [m], the middle one first.

    Parameters
    ----------
    diameter
        The lens' stop [m].
    across
        Points along it.
    """
    along = (np.arange(across) - across // 2) * (diameter / across)
    both = [(float(y), float(x)) for y in along for x in along if math.hypot(y, x) < diameter / 2]
    return sorted(both, key=lambda one: math.hypot(*one))


@runtime_checkable
class CameraWithField(Protocol):
    """Protocol of cameras that know the samples of their field in the focused plane."""

    @property
    def scene_grid(self) -> Grid:
        """Samples of the focused plane."""
        ...


def _field(camera: SeeingCamera) -> Grid:
    """Grid of the camera's field, at most 1024 samples along an axis."""
    if not isinstance(camera, CameraWithField):
        raise GeometryError(f"{type(camera).__name__} has no scene_grid. Give the grid of the field.")
    whole = camera.scene_grid
    coarser = max(1, math.ceil(max(whole.shape) / 1024))
    ny, nx = (max(1, n // coarser) for n in whole.shape)
    return Grid((ny, nx), (whole.pitch[0] * coarser, whole.pitch[1] * coarser), whole.center)


@dataclass(frozen=True, slots=True, eq=False)
class Tracer:
    """A renderer's scene, and where the main lens stands in it."""

    renderer: Any
    scene: Any
    pose: np.ndarray

    @classmethod
    def of(cls, source: str | os.PathLike[str] | Mapping[str, Any], pose: Any = None) -> "Tracer":
        """Scene of a file or of a description."""
        try:
            import mitsuba as renderer
        except ImportError:
            raise LumigraphError(
                "rendered scenes need Mitsuba 3. Run pip install 'lumigraph[scenes]'."
            ) from None
        renderer.set_variant("scalar_rgb")
        if not isinstance(source, Mapping) and not Path(source).is_file():
            raise FormatError(f"{source} is not there. Give a scene file (.xml) of Mitsuba 3.")
        try:
            scene = (
                renderer.load_dict(dict(source))
                if isinstance(source, Mapping)
                else renderer.load_file(os.fspath(source))
            )
        except Exception as error:  # all kinds, from inside the renderer
            name = "the scene" if isinstance(source, Mapping) else source
            raise FormatError(f"Mitsuba cannot read {name}: {' '.join(str(error).split())}") from None
        if not hasattr(scene, "sensors"):
            raise FormatError(f"{type(scene).__name__} is not a scene. Its type must be 'scene'.")
        if pose is not None:
            where = np.asarray(pose, float)
        elif scene.sensors():
            where = np.array(scene.sensors()[0].world_transform().matrix, float)
        else:
            where = TO_SCENE
        if where.shape != (4, 4) or not np.isfinite(where).all():
            raise GeometryError(f"pose has shape {where.shape} but must be (4, 4) and finite.")
        if abs(np.linalg.det(where[:3, :3])) < 1e-12:
            raise GeometryError("pose has no inverse: the main lens must look somewhere.")
        return cls(renderer, scene, where)

    def views(
        self,
        grid: Grid,
        focus: float,
        places: Sequence[tuple[float, float]],
        samples: int,
        seed: int,
    ) -> Iterator[LensView]:
        """Pictures that places on the lens see, at `FINER` pixels for each sample along an axis."""
        light = self.scene.integrator()
        kind = {"type": "path", "max_depth": 8} if light is None else light
        path = self.renderer.load_dict(kind) if isinstance(kind, dict) else kind
        where = self.renderer.load_dict({"type": "aov", "aovs": "p:position,n:sh_normal"})
        axes = self.pose[:3, :3] / np.linalg.norm(self.pose[:3, :3], axis=0)
        for k, place in enumerate(places):
            count = max(1, samples // FINER**2) * (MORE if k == 0 else 1)
            own = int(np.random.SeedSequence([seed, k]).generate_state(1)[0] >> 1)
            both = {"scene": self.scene, "sensor": self._sensor(grid, focus, place, axes), "seed": own}
            picture = np.array(self.renderer.render(**both, integrator=path, spp=count))
            told = np.array(self.renderer.render(**both, integrator=where, spp=1))
            position, normals = told[..., :3] - self.pose[:3, 3], told[..., 3:6]
            distance = (position @ axes[:, 2]).astype(np.float32)
            distance[~normals.any(-1)] = np.inf
            seen = normals @ axes  # x to the left, y up
            turned = np.stack([-seen[..., 1], -seen[..., 0], seen[..., 2]], -1).astype(np.float32)
            yield LensView(place, picture[..., :3].astype(np.float32), distance, turned)

    def _sensor(self, grid: Grid, focus: float, place: tuple[float, float], axes: np.ndarray) -> Any:
        """Pinhole at a place of the lens, whose frame is the grid in the focused plane."""
        (height, width), (y, x) = grid.size, place
        to_world = np.eye(4)
        to_world[:3, :3] = axes
        to_world[:3, 3] = self.pose[:3, 3] - y * axes[:, 1] - x * axes[:, 0]
        low_y = float(grid.y[0]) - grid.pitch[0] / 2 - y
        low_x = float(grid.x[0]) - grid.pitch[1] / 2 - x
        return self.renderer.load_dict({
            "type": "perspective",
            "fov": 2 * math.degrees(math.atan(width / 2 / focus)),
            "fov_axis": "x",
            "near_clip": 1e-3 * focus,
            "far_clip": 1e4 * focus,
            "principal_point_offset_x": (low_x + width / 2) / width,
            "principal_point_offset_y": (low_y + height / 2) / height,
            "to_world": self.renderer.ScalarTransform4f(to_world),
            "film": {
                "type": "hdrfilm", "pixel_format": "rgb", "rfilter": {"type": "box"},
                "width": grid.shape[1] * FINER, "height": grid.shape[0] * FINER,
            },
            "sampler": {"type": "independent"},
        })  # fmt: skip


@dataclass(eq=False)
class Layers:
    """Slices that grow as views of the scene come in.

    Parameters
    ----------
    grid
        Samples of the field in the focused plane.
    camera
        Whose main lens sees the slices.
    inverse
        (k,), 1/z of the slices [1/m], the farthest first.
    middle
        View of the lens' middle.
    """

    grid: Grid
    camera: SeeingCamera
    inverse: np.ndarray
    middle: LensView

    @classmethod
    def of(cls, middle: LensView, grid: Grid, camera: SeeingCamera, planes: int) -> "Layers":
        """No slices yet, between the nearest and the farthest thing that the middle of the lens sees."""
        there = np.isfinite(middle.distance)
        if not there.any():
            raise GeometryError("the main lens sees nothing of the scene. Check its pose and lengths [m].")
        if float(middle.distance[there].min()) <= 0:
            raise GeometryError("something stands nearer than the main lens. Move the camera back.")
        low, high = float(1 / middle.distance[there].max()), float(1 / middle.distance[there].min())
        inverse = np.linspace(low, high, planes) if planes > 1 else np.array([(low + high) / 2])
        return cls(grid, camera, inverse, middle)

    def __post_init__(self) -> None:
        parallax = self.camera.pupil_diameter / 2 * np.abs(self.camera.object_distance * self.inverse - 1)
        self._around = math.ceil(float(parallax.max()) / min(self.grid.pitch)) + 2
        shape = tuple(n + 2 * self._around for n in self.grid.shape)
        count = len(self.inverse)
        self._light = np.zeros((count, *shape, 3), np.float32)
        self._cover = np.zeros((count, *shape), np.float32)
        self._most = np.zeros((count, *shape), np.float32)
        self._change = Change(self.middle)
        self._places: list[tuple[float, float]] = []

    def numbers(self, view: LensView) -> np.ndarray:
        """Slice of each pixel of a view; -1 where nothing is."""
        step = self.inverse[1] - self.inverse[0] if len(self.inverse) > 1 else 0.0
        places = 1 / view.distance
        if step <= 1e-9 * self.inverse[-1]:
            found = np.zeros(places.shape, int)
        else:
            found = np.clip(np.rint((places - self.inverse[0]) / step), 0, len(self.inverse) - 1).astype(int)
        return np.where(np.isfinite(view.distance), found, -1)

    def add(self, view: LensView) -> None:
        """Add what a view sees to the slices."""
        self._check_open(view)
        numbers = self.numbers(view)
        self._places.append(view.place)
        for k in np.unique(numbers[numbers >= 0]).tolist():
            window, moved = self._moved((numbers == k)[..., None] * np.append(
                view.light, np.ones_like(view.light[..., :1]), axis=-1
            ), k, view.place)  # fmt: skip
            light, cover = moved[..., :3], moved[..., 3]
            self._light[k][window] += light
            self._cover[k][window] += cover
            self._most[k][window] = np.maximum(self._most[k][window], cover)
        if view is not self.middle:  # which has less noise than the others
            self._change.add(view, self._followed(view.place))

    def _followed(self, place: tuple[float, float]) -> np.ndarray:
        """Pixels (2, ny, nx) of a view at which it would see what the pixels of the middle one see."""
        at = np.indices(self.middle.distance.shape).astype(np.float32)
        factor = self.camera.object_distance / self.middle.distance - 1
        for axis in (0, 1):
            at[axis] -= place[axis] * factor * (FINER / self.grid.pitch[axis])
        return at

    def _moved(
        self, picture: np.ndarray, k: int, place: tuple[float, float]
    ) -> tuple[tuple[slice, slice], np.ndarray]:
        """Part of a slice (y, x) that a view's pixels of it fall on, and their mean over its samples."""
        factor = self.camera.object_distance * self.inverse[k] - 1
        starts, rests = [], []
        for axis in (0, 1):
            away = place[axis] * factor / self.grid.pitch[axis] + self._around
            first = math.floor(away)
            starts.append(first)
            rests.append((away - first) * FINER)
        ny, nx = (n + 1 for n in self.grid.shape)
        means = _coarser(_coarser(picture, rests[0]).swapaxes(0, 1), rests[1]).swapaxes(0, 1)
        return (slice(starts[0], starts[0] + ny), slice(starts[1], starts[1] + nx)), means

    def _check_open(self, view: LensView) -> None:
        """Refuse light that comes from nowhere."""
        whole, nowhere = view.light.sum(), view.light[~np.isfinite(view.distance)].sum()
        if nowhere > LEFT_OPEN * whole:
            raise GeometryError(
                f"{100 * nowhere / whole:.2g} % of the light comes from nowhere (an environment), but waves "
                "need a distance. Close the scene with a backdrop."
            )

    def finished(self, colour: bool) -> RaytracedScene:
        """The slices, and the truth."""
        glossy, noise = self._change.found()
        if glossy > GLOSSY:
            warnings.warn(
                f"surfaces' light changes by {100 * glossy:.2g} % rms over the main lens (gloss); slices "
                "keep its mean.",
                SamplingWarning,
                stacklevel=3,
            )
        parts = [part for k in range(len(self.inverse)) if (part := self._slice(k, colour)) is not None]
        light = self._mean(self.middle.light)
        depth = self._mean_depth()
        normals = self._mean(self.middle.normals)
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
        return RaytracedScene(
            Scene(parts), self.grid, light if colour else light @ LUMINANCE, depth, normals,
            self._mean(self._change.visibility()), glossy, noise,
        )  # fmt: skip

    def _slice(self, k: int, colour: bool) -> Slice | None:
        """A slice with what goes on behind nearer ones; None where it is empty."""
        covered = self._cover[k] > 1e-3
        if not covered.any():
            return None
        colours = self._light[k] / np.maximum(self._cover[k], 1e-3)[..., None]
        opacity = np.minimum(self._most[k], 1.0)
        found: Any = distance_transform_edt(~(opacity > 0.5), sampling=self.grid.pitch, return_indices=True)
        away, sources = found
        nearer = np.full(covered.shape, self.inverse[k])
        for j in range(k + 1, len(self.inverse)):
            nearer[self._most[j] > 0.5] = self.inverse[j]
        apart = self.camera.object_distance * (nearer - self.inverse[k])
        spacing = math.dist(*self._places[:2]) if len(self._places) > 1 else 0.0
        beyond = (apart > 0) & (away <= spacing * apart + BESIDE * max(self.grid.pitch))
        beyond &= opacity < 1
        colours[beyond & ~covered] = colours[tuple(sources)][beyond & ~covered]
        opacity[beyond] = 1.0
        size = float(1 / self.inverse[k] / self.camera.object_distance)
        shown = (colours if colour else colours @ LUMINANCE) * (opacity[..., None] if colour else opacity)
        pitch = self.grid.pitch[0] * size, self.grid.pitch[1] * size
        middle = self.grid.center[0] * size, self.grid.center[1] * size
        even = Grid((opacity.shape[0], opacity.shape[1]), pitch, middle)
        dz = float(1 / self.inverse[k] - self.camera.object_distance)
        return Slice(shown.astype(np.float32), even, dz, opacity).trimmed()

    def _mean(self, picture: np.ndarray) -> np.ndarray:
        return _blocks(picture).mean((1, 3))

    def _mean_depth(self) -> np.ndarray:
        """Median depth of each sample's pixels: no depth that stands between two things."""
        blocks = np.moveaxis(_blocks(self.middle.distance), 2, 1).reshape(*self.grid.shape, FINER**2)
        nearest = np.sort(blocks, axis=-1)[..., (FINER**2 - 1) // 2]
        return np.where(np.isfinite(nearest), nearest - self.camera.object_distance, np.nan).astype(
            np.float32
        )


class Change:
    """Change of surfaces' light over the main lens, at the places that its middle sees.

    Parameters
    ----------
    middle
        View of the lens' middle.
    """

    def __init__(self, middle: LensView) -> None:
        self.middle = middle
        shape = middle.distance.shape
        self._sums = np.zeros((4, *shape))  # of light, its square, light times y and times x
        self._seen = np.isfinite(middle.distance)
        self._asked, self._alike = np.ones(shape, np.float32), np.isfinite(middle.distance).astype(np.float32)
        self._places: list[tuple[float, float]] = []

    def add(self, view: LensView, at: np.ndarray) -> None:
        """Add a view, which would see the middle one's places at pixels `at` (2, ny, nx)."""
        light = map_coordinates(view.light @ LUMINANCE, at, order=1, mode="constant", cval=np.nan)
        distance = map_coordinates(view.distance, np.nan_to_num(at), order=0, mode="constant", cval=np.nan)
        with np.errstate(invalid="ignore"):
            same = np.abs(distance / self.middle.distance - 1) < ALIKE
        self._asked += ~np.isnan(distance)
        self._alike += same
        self._seen &= same
        light = np.nan_to_num(light)
        self._sums += np.stack([light, light**2, view.place[0] * light, view.place[1] * light])
        self._seen &= light > 0
        self._places.append(view.place)

    def visibility(self) -> np.ndarray:
        """Part of the views, whose frame holds a place, that see it (ny, nx)."""
        return self._alike / self._asked

    def found(self) -> tuple[float, float]:
        """Change that a plane over the lens explains beyond noise and chance, and the noise.

        Relative rms, where all views see the same.
        """
        views = len(self._places)
        if views < 4 or not self._seen.any():
            return 0.0, 0.0
        light, squares, down, across = self._sums[:, self._seen]
        spread = (np.array(self._places) ** 2).sum(0)
        planes = down**2 / spread[0] + across**2 / spread[1]
        rest = max(0.0, float((squares - light**2 / views - planes).mean())) / (views - 3)
        level = max(float((light**2).mean()) / views**2, 1e-30)
        chance = 3 * float(planes.std()) / math.sqrt(planes.size)
        excess = float(planes.mean()) - 2 * rest
        glossy = excess / views / level if excess > chance else 0.0
        return math.sqrt(glossy), math.sqrt(rest / views / level)


def _coarser(picture: np.ndarray, away: float) -> np.ndarray:
    """Means over samples along the first axis, of pixels moved by less than a sample [px]: one more."""
    count, whole = len(picture) // FINER + 1, math.floor(away)
    moved = np.zeros((count * FINER, *picture.shape[1:]), picture.dtype)
    for first, weight in ((whole, 1 - away + whole), (whole + 1, away - whole)):
        moved[first : first + len(picture)] += np.float32(weight / FINER) * picture
    return moved.reshape(count, FINER, *picture.shape[1:]).sum(1)


def _blocks(picture: np.ndarray) -> np.ndarray:
    """(y, FINER, x, FINER, ...) of a picture of rays' pixels."""
    ny, nx = picture.shape[:2]
    return picture.reshape(ny // FINER, FINER, nx // FINER, FINER, *picture.shape[2:])
