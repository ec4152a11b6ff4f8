"""Steps of cameras 1.0 and of views."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lumigraph import io
from lumigraph.core.arrays import to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.progress import Progress
from lumigraph.depth import alpha_of, disparity_of, drawn, epi
from lumigraph.depth.pictures import measurable
from lumigraph.errors import FormatError
from lumigraph.processing.shown import FRAMES, ends, save_film, save_picture
from lumigraph.processing.steps import Step
from lumigraph.rendering import all_in_focus, decode, detail, refocus_stack
from lumigraph.rendering.focus_range import focus_range
from lumigraph.rendering.sharp import AllInFocus
from lumigraph.viewer.exhibit import comfortable, grey_or_colour

VIEWS = "views.zarr"
_PLANES = 33  # refocus factors that are tried where views are too small for lines
_SPARE = 0.3  # of the depths that occur, that a film goes beyond them on each side
_LEAST = 0.02  # refocus factor


class FromViews:
    """Depth, pictures and a film of a light field, each computed once.

    Parameters
    ----------
    source
        Light field; or the raw image that it is decoded from.
    """

    def __init__(self, source: LightField | PreparedImage) -> None:
        self._source = source

    @cached_property
    def views(self) -> LightField:
        """The light field."""
        if isinstance(self._source, LightField):
            return self._source
        if self._source.calibration is None:
            raise FormatError("the raw image was not prepared with a calibration. Use lumigraph.prepare.")
        return decode(self._source, self._source.calibration)

    @cached_property
    def _comfortable(self) -> tuple[LightField, bool]:
        return comfortable(grey_or_colour(self.views))

    @property
    def shown(self) -> LightField:
        """The light field as the viewer shows it: its refocus factors are above 0."""
        return self._comfortable[0]

    @cached_property
    def depth(self) -> DepthMap:
        """Refocus factors of the middle view of `shown`; NaN where a lens could not focus."""
        if measurable(self.shown):
            found = alpha_of(epi(self.shown), self.shown)
            factors = to_numpy(found.values).astype(float)
            return replace(found, values=np.where(factors > _LEAST, factors, np.nan))
        alphas = np.linspace(*focus_range(self.shown), _PLANES)
        made = all_in_focus(self.shown, alphas, oversample=1)
        return DepthMap(to_numpy(made.alpha), to_numpy(made.confidence), "alpha")

    @cached_property
    def disparity(self) -> DepthMap:
        """Disparities of the middle view [lenslets per view]."""
        return disparity_of(self.depth, self.shown)

    @cached_property
    def sharp(self) -> AllInFocus:
        """Picture that is sharp at every depth."""
        return all_in_focus(self.shown, depth=to_numpy(self.depth.values))

    def alphas(self) -> np.ndarray:
        """Refocus factors of the film, from near to far, somewhat beyond what is there."""
        low, high = ends(self.depth)
        least, most = focus_range(self.shown)
        spare = max(_SPARE * (high - low), 0.05 * (most - least))
        return np.linspace(max(low - spare, min(least, low)), min(high + spare, max(most, high)), FRAMES)

    def steps(self, source: str, *, decoded: bool) -> list[Step]:
        """Files that are written; `decoded`: the views come from a raw image."""

        def write_views(folder: Path, progress: Progress) -> None:
            io.save(self.views, folder / VIEWS)

        def write_depth(folder: Path, progress: Progress) -> None:
            io.save(self.disparity, folder / "depth.tiff")
            io.save(drawn(self.disparity, self.shown), folder / "depth.png", white=1.0)

        def write_picture(folder: Path, progress: Progress) -> None:
            save_picture(self.sharp.picture, folder / "all-in-focus.png")

        def write_film(folder: Path, progress: Progress) -> None:
            save_film(refocus_stack(self.shown, self.alphas(), progress=progress), folder / "refocus.gif")

        steps = [Step("views", (VIEWS,), write_views, source, 2.0)] if decoded else []
        return [
            *steps,
            Step("depth", ("depth.tiff", "depth.png"), write_depth, source, 3.0),
            Step("all-in-focus", ("all-in-focus.png",), write_picture, source, 2.0),
            Step("film", ("refocus.gif",), write_film, source, 4.0),
        ]

    def about(self) -> list[str]:
        """Notes on the pictures."""
        nv, nu, nt, ns = self.shown.data.shape[:4]
        times, relative = detail(self.shown), self._comfortable[1]
        low, high = ends(self.disparity if relative else self.depth)
        about = (
            f"disparities go from {low:.3g} to {high:.3g} px per view"
            if relative
            else f"what is there is sharp at refocus factors from {low:.4g} to {high:.4g}"
        )
        return [
            f"{nv} x {nu} views of {nt} x {ns} px; pictures have {times} samples per lenslet, "
            f"{(nt - 1) * times + 1} x {(ns - 1) * times + 1} px",
            about,
            "depth.tiff holds disparities [lenslets per view], positive nearer than the focused plane",
        ]
