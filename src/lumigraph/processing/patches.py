"""Steps of plenoptic cameras 2.0."""

from functools import cached_property
from pathlib import Path

import numpy as np

from lumigraph import io
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.progress import Progress
from lumigraph.depth import drawn, of_pixels
from lumigraph.depth.of_pixels import PixelDepth
from lumigraph.instruments import Instrument
from lumigraph.instruments.capabilities import Rendered, WithDepth
from lumigraph.processing.shown import FRAMES, ends, save_film, save_picture
from lumigraph.processing.steps import Step
from lumigraph.rendering import render, render_stack

_SPARE = 0.25  # of the patches that occur, that a film goes beyond them on each side


class FromPatches:
    """Depth, pictures and a film of a camera 2.0, each computed once.

    Parameters
    ----------
    raw
        Prepared raw image.
    calibration
        Its lattice.
    focus
        Patch [px] at which each of three kinds of lenslets is sharp; None where unknown.
    camera
        Its description, or None.
    """

    def __init__(
        self, raw: PreparedImage, calibration: Calibration, focus: list[float] | None,
        camera: Instrument | None,
    ) -> None:  # fmt: skip
        self.raw, self.calibration, self.focus = raw, calibration, focus
        self.camera = camera if isinstance(camera, Rendered) and isinstance(camera, WithDepth) else None

    @cached_property
    def depth(self) -> PixelDepth:
        """Patches of the picture's pixels and of the lenslets."""
        return of_pixels(self.raw, self.calibration, focus=self.focus)

    @property
    def map(self) -> DepthMap:
        """Depth of each pixel from the focused plane [m] where the camera is known, else patches [px]."""
        found = self.depth.depth
        return found if self.camera is None else self.camera.in_metres(found, self.calibration)

    @cached_property
    def sharp(self) -> Array:
        """Picture that is sharp at every depth."""
        depth = self.depth
        return render(
            self.raw, self.calibration, to_numpy(depth.lenslets.values), blend=True, focus=depth.focus
        )

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest patch that occurs [px], but for a few."""
        return ends(self.depth.lenslets)

    def sizes(self) -> np.ndarray:
        """Patches of the film [px], somewhat beyond what is there, below the pitch and of one sign."""
        low, high = self.ends
        spare = max(_SPARE * (high - low), 0.5)
        sizes = np.linspace(low - spare, high + spare, FRAMES)
        most = 0.98 * self.calibration.lattice.pitch
        return np.unique(np.copysign(np.clip(np.abs(sizes), 1.0, most), (low + high) / 2))

    def steps(self, source: str) -> list[Step]:
        """Files that are written."""

        def write_depth(folder: Path, progress: Progress) -> None:
            io.save(self.map, folder / "depth.tiff")
            io.save(drawn(self.map), folder / "depth.png", white=1.0)

        def write_picture(folder: Path, progress: Progress) -> None:
            save_picture(self.sharp, folder / "all-in-focus.png")

        def write_film(folder: Path, progress: Progress) -> None:
            stack = render_stack(self.raw, self.calibration, self.sizes().tolist(), focus=self.depth.focus)
            save_film(stack, folder / "refocus.gif")

        return [
            Step("depth", ("depth.tiff", "depth.png"), write_depth, source, 4.0),
            Step("all-in-focus", ("all-in-focus.png",), write_picture, source),
            Step("film", ("refocus.gif",), write_film, source, 4.0),
        ]

    def about(self) -> list[str]:
        """Notes on the pictures."""
        (low, high), (rows, columns) = self.ends, self.sharp.shape[:2]
        told = [f"{rows} x {columns} px, of patches from {low:.4g} to {high:.4g} px of each micro-image"]
        if self.calibration.lattice.kinds > 1 and self.focus is None:
            told.append(
                "at which patch each kind of lenslets is sharp is not known, so that all kinds were mixed: "
                "give --camera, or the maker's calibration, for a sharper picture"
            )
        if self.camera is not None:
            return [*told, "depth.tiff holds depths from the focused plane [m], positive farther"]
        return [*told, "depth.tiff holds patches [px], larger is nearer; for metres, give --camera"]
