# pyright: reportMissingImports=false
"""Widgets: calibrate, decode, depth."""

from typing import Any

from magicgui.widgets import ComboBox, FloatSpinBox, SpinBox

from lumigraph import depth
from lumigraph.calibration import calibrate
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, Stage
from lumigraph.core.raw import RawImage
from lumigraph.errors import LumigraphError
from lumigraph.napari.panel import Panel, chosen
from lumigraph.napari.shown import depth_beside, layer_of
from lumigraph.napari.work import Job
from lumigraph.preparation import decode, prepare

_LAYOUTS: list[tuple[str, Any]] = [
    ("found", None),
    ("square", "square"),
    ("hexagonal", "hex"),
    ("rectangular", "rectangular"),
]
_FOCI = 21


class Calibrate(Panel):
    """A white image's lattice of micro-images, as points."""

    def __init__(self, napari_viewer: Any) -> None:
        self.viewer = napari_viewer
        self.white = self.choice(RawImage, "White image")
        self.layout_choice = ComboBox(choices=_LAYOUTS, label="Layout", nullable=True)
        self.pitch = FloatSpinBox(value=0, min=0, max=10_000, step=0.1, label="Pitch [px], 0: found")
        super().__init__(napari_viewer, [self.white, self.layout_choice, self.pitch], "Calibrate")

    def job(self) -> Job:
        """A calibration."""
        white, layout = chosen(self.white, RawImage, "a white image"), self.layout_choice.value
        pitch = self.pitch.value or None

        def work(tell: Progress) -> Calibration:
            tell(Stage(0.0, "calibrating"))
            return calibrate(white, layout, pitch, progress=tell)

        return work

    def take(self, found: Calibration) -> str:
        """Points in the middle of the micro-images."""
        self.put(layer_of(found, "calibration"))
        lattice = found.lattice
        return f"{lattice.layout} lattice, pitch {lattice.pitch:.3f} px, residual {found.residual_px:.3f} px"


class Decode(Panel):
    """Views of a raw image."""

    def __init__(self, napari_viewer: Any) -> None:
        self.viewer = napari_viewer
        self.raw = self.choice(RawImage, "Raw image")
        self.calibration = self.choice(Calibration, "Calibration", optional=True)
        self.white = self.choice(RawImage, "White image", optional=True)
        self.samples = SpinBox(value=1, min=1, max=8, label="Samples per lenslet")
        controls = [self.raw, self.calibration, self.white, self.samples]
        super().__init__(napari_viewer, controls, "Decode")

    def job(self) -> Job:
        """A light field."""
        raw, samples = chosen(self.raw, RawImage, "a raw image"), self.samples.value
        given = self.calibration.value and chosen(self.calibration, Calibration, "a calibration")
        white = self.white.value and chosen(self.white, RawImage, "a white image")
        if given is None and white is None:
            raise LumigraphError("decoding needs a calibration or a white image. Choose one of them.")

        def work(tell: Progress) -> LightField:
            tell(Stage(0.0, "preparing"))
            ready = prepare(raw, given, white=white)
            tell(Stage(0.5, "decoding"))
            return decode(ready, samples=samples)

        return work

    def take(self, found: LightField) -> str:
        """Views on two sliders."""
        self.put(layer_of(found, "views"))
        nv, nu, nt, ns = found.data.shape[:4]
        middle = (nv // 2, nu // 2)
        self.viewer.dims.set_current_step((0, 1), middle)
        return f"{nv} × {nu} views of {nt} × {ns}"


class Depth(Panel):
    """A depth map of the middle view."""

    def __init__(self, napari_viewer: Any) -> None:
        self.viewer = napari_viewer
        self.views = self.choice(LightField, "Views")
        ways = [("lines of epipolar-plane images", "epi"), ("sharpest picture of a stack", "focus")]
        self.way = ComboBox(choices=ways, label="Method")
        super().__init__(napari_viewer, [self.views, self.way], "Measure depth")

    def job(self) -> Job:
        """The views and their depth map."""
        views = chosen(self.views, LightField, "views")
        by_lines = self.way.value == "epi"

        def work(tell: Progress) -> tuple[LightField, depth.DepthMap]:
            if by_lines:
                return views, depth.epi(views, progress=tell)
            tell(Stage(0.0, "refocusing"))
            return views, depth.from_focus(views, _foci(views))

        return work

    def take(self, found: tuple[LightField, depth.DepthMap]) -> str:
        """Colours over the middle view."""
        views, map_ = found
        self.put(depth_beside(views, map_, "depth"))
        return f"{map_.quantity}, {map_.unit}: mean confidence {float(map_.confidence.mean()):.2f}"


def _foci(views: LightField) -> Any:
    import numpy as np

    from lumigraph.rendering.focus_range import focus_range

    return np.linspace(*focus_range(views), _FOCI)
