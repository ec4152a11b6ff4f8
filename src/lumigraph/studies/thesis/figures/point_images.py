"""Cameras of the experiments of chapter 5, and images of points behind them.

The lenslets are round, as the thesis takes them to be (2.44 λ F#). The wavelength is that of the helium-neon
laser, 632.8 nm: with it the printed formulas give the numbers of Tables 5.3 and 5.4.
"""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.cache import remembered
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.instruments import FocusedPlenopticCamera, SingleLensCamera
from lumigraph.instruments.parts import MainLens, Pixels
from lumigraph.rendering import render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.scene import targets
from lumigraph.simulation import simulate

WAVELENGTH = 632.8e-9
MAGNIFICATIONS = (0.5, 0.3, 0.25)


def camera(magnification: float, lenslets: int) -> FocusedPlenopticCamera:
    """The thesis' camera (Tables 5.1 and 5.2) with round lenslets, `lenslets` of them per axis."""
    name = f"thesis-plenoptic-2-m{round(100 * magnification):03d}"
    return FocusedPlenopticCamera.from_catalogue(name).replace(
        wavelength=WAVELENGTH, lenslets={"shape": "round", "count": (lenslets, lenslets)}
    )


def main_lens_camera(plenoptic: FocusedPlenopticCamera, pixels: int = 401) -> SingleLensCamera:
    """The same main lens with a sensor in its image."""
    return SingleLensCamera(
        wavelength=plenoptic.wavelength,
        object_distance=plenoptic.object_distance,
        main_lens=MainLens(focal_length=plenoptic.main_lens.focal_length, diameter=plenoptic.pupil_diameter),
        sensor=Pixels(pixel_pitch=plenoptic.pixels.pixel_pitch, shape=(pixels, pixels)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class PointRendering:
    """Points seen by the main lens alone, on the sensor, and in the rendered picture.

    Parameters
    ----------
    camera
        Camera of the images.
    main, main_grid
        Main-lens image (y, x), and where its samples stand [m].
    raw
        Raw image.
    rendered, rendered_grid
        Rendered picture (y, x), and where its samples stand in the main-lens image [m].
    """

    camera: FocusedPlenopticCamera
    main: np.ndarray
    main_grid: Grid
    raw: RawImage
    rendered: np.ndarray
    rendered_grid: Grid

    @classmethod
    def of(
        cls, camera: FocusedPlenopticCamera, positions: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    ) -> "PointRendering":
        """Exact images of points at `positions` (y, x) of the focused plane [m]; their intensities add."""
        scene, alone = targets.points([(y, x, 0.0) for y, x in positions]), main_lens_camera(camera)
        raw, calibration = simulate(camera, scene), camera.calibration
        return cls(
            camera, np.asarray(simulate(alone, scene).data, float), alone.sensor.grid, raw,
            np.asarray(render(raw, calibration, camera.patch), float),
            rendered_grid(calibration, camera.patch),
        )  # fmt: skip

    @property
    def main_profile(self) -> tuple[np.ndarray, np.ndarray]:
        """Places x [m] and intensity along the row on the axis, main lens."""
        return self.main_grid.x, self.main[self.main_grid.shape[0] // 2]

    @property
    def rendered_profile(self) -> tuple[np.ndarray, np.ndarray]:
        """Places x [m] and intensity along the row on the axis, rendered picture."""
        return self.rendered_grid.x, self.rendered[int(np.argmin(np.abs(self.rendered_grid.y)))]

    @property
    def micro_image(self) -> tuple[np.ndarray, Grid]:
        """Image of a point on the axis by the lenslet there, and its grid in the main-lens image [m].

        It holds the rendered picture's point image before it is cut into patches. The other lenslets are
        dark: what they send across their borders would be taken for frequencies beyond the lenslet's cut-off.
        """
        pixel, m = self.camera.pixels.pixel_pitch, self.camera.lenslet_magnification
        half = int(self.camera.lenslets.pitch * (1 + abs(m)) / 2 / pixel)
        lone = self.camera.replace(
            lenslets={"count": (1, 1)},
            sensor={"shape": self.camera.sensor.shape},
            main_lens={"diameter": self.camera.pupil_diameter},
        )
        data = np.asarray(simulate(lone, targets.points([(0.0, 0.0)])).data, float)
        ny, nx = data.shape
        part = data[ny // 2 - half : ny // 2 + half + 1, nx // 2 - half : nx // 2 + half + 1]
        return part, Grid.square(2 * half + 1, pixel / abs(m))


@remembered
def on_axis(magnification: float, lenslets: int) -> PointRendering:
    """A point on the axis of the thesis' camera, which Tables 5.3 and 5.4 measure."""
    return PointRendering.of(camera(magnification, lenslets))
