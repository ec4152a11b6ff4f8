"""Steps of light-field microscopes."""

from functools import cached_property
from pathlib import Path

import numpy as np

from lumigraph import io
from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.progress import Progress, silent, within
from lumigraph.core.volume import Volume
from lumigraph.deconvolution import Deconvolver, RichardsonLucy, Stop
from lumigraph.deconvolution.run import RunStep
from lumigraph.depth import drawn
from lumigraph.instruments import Instrument
from lumigraph.instruments.smoothing import low_pass_of
from lumigraph.processing.shown import save_film, save_picture
from lumigraph.processing.steps import Step
from lumigraph.viewer.opening import depth_reach

VOLUME = "volume.ome.tif"
_PLANES, _SAMPLES, _ITERATIONS = 11, 3, 10
_LEAST_BRIGHT = 0.2  # of the brightest: darker places have no depth


class FromVolume:
    """Volume of a microscope's raw image, and pictures of it.

    Parameters
    ----------
    raw
        Raw image that was prepared for a deconvolution.
    camera
        Its description.
    volume
        The volume where it stands from a former run.
    """

    def __init__(self, raw: PreparedImage, camera: Instrument, standing: Path | None) -> None:
        self.raw, self.camera, self._standing = raw, camera, standing
        self._progress: Progress = silent

    @property
    def depths(self) -> tuple[float, ...]:
        """Depths of the planes [m], within the range in which the microscope refocuses well."""
        reach = depth_reach(self.camera)  # type: ignore[arg-type] - a camera of any kind
        return tuple(float(z) for z in np.linspace(-reach, reach, _PLANES))

    @cached_property
    def volume(self) -> Volume:
        """The volume, deconvolved by accelerated Richardson-Lucy."""
        if self._standing is not None:
            found = io.open(self._standing)
            assert isinstance(found, Volume)  # process wrote it
            return found
        tell, rest = within(self._progress, 0.0, 0.6, "point images"), within(self._progress, 0.6, 1.0)
        operator = self.camera.operator_for(self.raw.calibration, self.depths, _SAMPLES, tell)
        method = RichardsonLucy(None, low_pass_of(self.camera, operator), accelerated=True)

        def follow(step: RunStep) -> None:
            rest(step.iteration / step.iterations)

        engine = Deconvolver(operator, Stop(_ITERATIONS), method=method)
        found = engine(self.raw, engine.known(self.raw, None), progress=follow)
        assert isinstance(found, Volume)  # of a microscope
        return found

    @cached_property
    def depth(self) -> DepthMap:
        """Depth of the brightest sample of each place [m], NaN where it is dark."""
        data = to_numpy(self.volume.data)
        most = data.max(0)
        bright = most / max(float(np.quantile(most, 0.999)), 1e-30)
        depths = np.asarray(self.volume.depths)[data.argmax(0)]
        return DepthMap(
            np.where(bright > _LEAST_BRIGHT, depths, np.nan), np.clip(bright, 0, 1), "depth"
        )  # fmt: skip

    def steps(self, source: str) -> list[Step]:
        """Files that are written."""

        def write_volume(folder: Path, progress: Progress) -> None:
            self._progress, self._standing = progress, None
            io.save(self.volume, folder / VOLUME)

        def write_depth(folder: Path, progress: Progress) -> None:
            io.save(self.depth, folder / "depth.tiff")
            io.save(drawn(self.depth), folder / "depth.png", white=1.0)

        def write_picture(folder: Path, progress: Progress) -> None:
            save_picture(to_numpy(self.volume.data).max(0), folder / "all-in-focus.png")

        def write_film(folder: Path, progress: Progress) -> None:
            save_film(self.volume.data, folder / "refocus.gif")

        return [
            Step("volume", (VOLUME,), write_volume, source, 20.0),
            Step("depth", ("depth.tiff", "depth.png"), write_depth, source),
            Step("all-in-focus", ("all-in-focus.png",), write_picture, source),
            Step("film", ("refocus.gif",), write_film, source),
        ]

    def about(self) -> list[str]:
        """Notes on the pictures."""
        nz, ny, nx = self.volume.shape
        first, last = (1e6 * z for z in (self.volume.depths[0], self.volume.depths[-1]))
        return [
            f"volume of {nz} x {ny} x {nx} samples (z, y, x), from {first:.3g} to {last:.3g} um around the "
            f"focused plane, {_ITERATIONS} iterations of accelerated Richardson-Lucy",
            "all-in-focus.png shows the brightest sample along z, refocus.gif the planes one after the other",
            "depth.tiff holds the depth of the brightest sample [m], positive farther from the objective; "
            "dark places are unknown",
            "for other depths, samples or iterations use 'lumigraph deconvolve'",
        ]
