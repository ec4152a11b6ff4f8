"""The pictures that a data sheet is measured on, simulated from a camera file."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from lumigraph.core import checks, upper_floors
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress, silent
from lumigraph.core.short_repr import brief
from lumigraph.design import thin_lens
from lumigraph.instruments import LensletCamera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.metrology.datasheet.charts import ChartExposures, Charts, check_camera
from lumigraph.metrology.datasheet.exposures import DrawnExposures
from lumigraph.scene import Scene, targets
from lumigraph.simulation import Incoherent, simulate

FILL = 0.8
"""Part of a full well that white images and charts fill."""

ACCURACY = 1e-2
"""Accuracy of simulated charts, as good as their noise: at 1e-3 an image out of focus may take minutes."""

EXPOSURES = 16
"""Exposures of each light, for small sensors. The sheet says where the noise of depth needs more."""

_PIXELS = 40e6
"""Pixels of all exposures of a light together: the sheet of five planes then takes some minutes."""

_FLATS = (0.1, 0.25, 0.45, 0.65)  # the same of further white images, for photon transfer
_CELL = 22.0  # samples of the picture to a square, of the farthest chart
_GRAIN = 1.5  # samples: blur of the texture
_TURN = math.radians(7)
_DISPARITIES = (-1.5, -0.75, 0.0, 0.75, 1.5)  # lenslets from one direction that is told apart to the next
_MAGNIFICATIONS = (0.75, 0.87, 1.0, 1.15, 1.3)  # of the lenslets over that of the plane in focus


def usual_depths(camera: LensletCamera) -> tuple[float, ...]:
    """Depths of five charts [m]: over what the camera refocuses, those beyond its reach left out."""
    f, focused, found = camera.main_lens.focal_length, camera.object_distance, []
    # A direction is as wide as a pixel, or as the lenslet's diffraction if that is wider.
    b, pitch = camera.lenslet_distance, camera.lenslets.pitch
    direction = max(camera.sensor.pixel_pitch, camera.wavelength * b / pitch) * camera.separation / b
    for change in _MAGNIFICATIONS if isinstance(camera, Rendered) else _DISPARITIES:
        if isinstance(camera, Rendered):
            image = camera.separation - (camera.separation - camera.image_distance) / change
        else:
            image = camera.separation / max(1 - change * pitch / direction, 1e-3)
        if f < image < 20 * f:
            found.append(round(thin_lens.object_distance(f, image) - focused, 9))
    return tuple(sorted(set(found)))


def usual_exposures(camera: LensletCamera) -> int:
    """Exposures of each light: fewer for a large sensor, whose many places make up for it."""
    rows, columns = camera.sensor.shape
    return int(np.clip(_PIXELS / (rows * columns), 2, EXPOSURES))


def simulate_charts(
    camera: LensletCamera | str | PathLike[str],
    depths: Sequence[float] | None = None,
    *,
    name: str = "camera",
    rng: np.random.Generator | None = None,
    exposures: int | None = None,
    accuracy: float = ACCURACY,
    progress: Progress = silent,
) -> Charts:
    """The pictures that a laboratory would take with a camera, by wave optics and with its sensor's noise.

    Parameters
    ----------
    camera
        A plenoptic camera 1.0 or 2.0, its file, or a name of the catalogue.
    depths
        Of the charts from the plane in focus [m]; None for `usual_depths`.
    name
        Of the camera.
    rng
        Random numbers of the noise.
    exposures
        Of each chart, of the white and of the dark image; None for `usual_exposures`.
    accuracy
        Of the charts' pictures, relative rms; the white image's is 1e-3.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        Another kind of camera, or a depth inside the focal length.
    """
    camera = upper_floors.camera(camera)
    rng = np.random.default_rng(0) if rng is None else rng
    count = (
        usual_exposures(check_camera(camera)) if exposures is None else checks.whole("exposures", exposures)
    )
    lights = Lights.of(camera, depths, accuracy=accuracy, progress=progress)
    return lights.exposed(rng, name, exposures=count)


@dataclass(frozen=True, slots=True, eq=False)
class Lights:
    """Light on a camera's sensor of white images and charts, before noise.

    Parameters
    ----------
    camera
        That they belong to.
    white
        Of an evenly lit diffuser (y, x).
    charts
        (depth [m], board, texture) of each distance; None in the place of a texture that is not wanted.
    spacing
        Width of the board's squares [m]; None without charts.
    """

    camera: LensletCamera
    white: np.ndarray
    charts: tuple[tuple[float, np.ndarray, np.ndarray | None], ...]
    spacing: float | None

    __repr__ = brief

    @classmethod
    def of(
        cls,
        camera: LensletCamera,
        depths: Sequence[float] | None = None,
        *,
        textured: bool = True,
        accuracy: float = ACCURACY,
        progress: Progress = silent,
    ) -> "Lights":
        """Light by wave optics; parameters and errors as in `simulate_charts`.

        Without `textured`, random patterns for depth are left out.
        """
        camera = check_camera(camera)
        depths = usual_depths(camera) if depths is None else tuple(depths)
        white = np.asarray(to_numpy(simulate(camera, targets.white()).data))
        progress(1 / (len(depths) + 1))
        spacing = float(f"{max(_CELL * _sample(camera, depth) for depth in depths):.3g}") if depths else None
        charts = []
        for k, depth in enumerate(depths, 2):
            canvas = _canvas(camera, depth)
            scenes = [_board(canvas, spacing or 1.0)]
            if textured:
                scenes.append(targets.texture(canvas, _GRAIN * _sample(camera, depth), seed=k))
            seen = [
                np.asarray(to_numpy(simulate(camera, one.at(depth), Incoherent(accuracy)).data))
                for one in scenes
            ]
            charts.append((depth, seen[0], seen[1] if textured else None))
            progress(k / (len(depths) + 1))
        return cls(camera, white, tuple(charts), spacing)

    def exposed(
        self, rng: np.random.Generator, name: str = "camera", *, exposures: int = EXPOSURES
    ) -> Charts:
        """Raw images with the sensor's noise, drawn when they are used."""
        sensor, top = self.camera.sensor, float(np.quantile(self.white, 0.999))

        def several(light: np.ndarray, fill: float = FILL, count: int = max(2, exposures)) -> DrawnExposures:
            return DrawnExposures(light, sensor, top, fill, tuple(rng.integers(2**63, size=count).tolist()))

        boards = tuple(
            ChartExposures(
                several(board, count=exposures),
                () if texture is None else several(texture, count=exposures),
                depth,
            )
            for depth, board, texture in self.charts
        )
        white = self.white
        flats = tuple(several(white, fill, 2)[:] for fill in _FLATS)
        return Charts(
            name, several(white), several(0 * white), tuple((one, other) for one, other in flats), boards,
            camera=self.camera, spacing=self.spacing,
        )  # fmt: skip


def _sample(camera: LensletCamera, depth: float) -> float:
    """Distance between samples of a picture, on a chart at a depth [m]."""
    per = max(1, abs(round(camera.patch_at(depth)))) if isinstance(camera, Rendered) else 1
    return camera.lenslets.pitch * camera.defocused(depth) / camera.separation / per


def _canvas(camera: LensletCamera, depth: float) -> Grid:
    """Samples of a plane at a depth, wider than what the camera sees there."""
    wide, grid = 1.1 * max(1.0, camera.defocused(depth) / camera.object_distance), camera.object_grid
    shape = tuple(math.ceil(n * wide) for n in grid.shape)
    return Grid((shape[0], shape[1]), grid.pitch, grid.center)


def _board(canvas: Grid, spacing: float) -> Scene:
    """A chessboard beyond the canvas; a square is on the axis, no corner."""
    count = 2 * math.ceil(0.75 * max(canvas.size) / spacing) + 2
    return targets.chessboard(canvas, (count, count), spacing, angle=_TURN)
