# pyright: reportMissingImports=false
"""Widget: the picture that follows a slider of the focus, and one of the aperture."""

from typing import Any

from magicgui.widgets import FloatSlider

from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress
from lumigraph.errors import LumigraphError
from lumigraph.napari.panel import Panel, chosen
from lumigraph.napari.shown import beside
from lumigraph.napari.work import Job
from lumigraph.rendering import reduce_aperture, refocus
from lumigraph.rendering.focus_range import focus_range

_RESTING = 1.0  # α' of what was focused


class Refocus(Panel):
    """A picture focused by a slider; it follows while the slider moves, as fast as it can be computed."""

    def __init__(self, napari_viewer: Any) -> None:
        self.viewer = napari_viewer
        self.views = self.choice(LightField, "Views")
        self.alpha = FloatSlider(value=_RESTING, min=0.5, max=1.5, step=1e-4, label="Focus α′")
        self.aperture = FloatSlider(value=1.0, min=0.05, max=1.0, step=0.01, label="Aperture")
        super().__init__(napari_viewer, [self.views, self.alpha, self.aperture], "Refocus")
        self.waiting = False
        self.views.changed.connect(self._fit)
        for slider in (self.alpha, self.aperture):
            slider.changed.connect(self._moved)
        self._fit()

    def job(self) -> Job:
        """The views and their picture."""
        views = chosen(self.views, LightField, "views")
        alpha, part = self.alpha.value, self.aperture.value

        def work(_: Progress) -> tuple[LightField, Any]:
            return views, refocus(reduce_aperture(views, part) if part < 1 else views, alpha, oversample=1)

        return work

    def take(self, found: tuple[LightField, Any]) -> str:
        """The picture over the views; another follows where the slider has moved meanwhile."""
        views, picture = found
        self.put(beside(views, picture, "refocused"))
        if self.waiting:
            self.waiting = False
            self.start()
        return f"α′ = {self.alpha.value:.4f}"

    def _moved(self, _: Any = None) -> None:
        if self.views.value is None:
            return
        self.waiting = self.work.is_running
        self.start()

    def _fit(self, _: Any = None) -> None:
        """The slider spans what is worth looking at in the chosen views."""
        try:
            low, high = focus_range(chosen(self.views, LightField, "views"))
        except LumigraphError:
            return
        with self.alpha.changed.blocked():
            self.alpha.min, self.alpha.max = min(low, self.alpha.min), max(high, self.alpha.max)
            self.alpha.value = min(max(self.alpha.value, low), high)
            self.alpha.min, self.alpha.max = low, high
