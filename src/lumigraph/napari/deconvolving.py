# pyright: reportMissingImports=false
"""Widget: the object before a microscope or a focused camera, from one raw image."""

from pathlib import Path
from typing import Any

import numpy as np
from magicgui.widgets import CheckBox, FileEdit, FloatSpinBox, LineEdit, SpinBox

from lumigraph.core.calibration import Calibration
from lumigraph.core.progress import Progress, Stage, within
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Interrupted, RichardsonLucy, deconvolve
from lumigraph.deconvolution.run import RunStep
from lumigraph.errors import LumigraphError
from lumigraph.instruments import load_camera
from lumigraph.instruments.smoothing import low_pass_of
from lumigraph.napari.panel import Panel, chosen
from lumigraph.napari.shown import layer_of
from lumigraph.napari.work import Job
from lumigraph.preparation import prepare
from lumigraph.units import um

_MODEL = 0.5  # of the bar: building the operator


class Deconvolve(Panel):
    """A volume, or a picture; stopped early, it shows what was reached."""

    def __init__(self, napari_viewer: Any) -> None:
        self.viewer = napari_viewer
        self.raw = self.choice(RawImage, "Raw image")
        self.calibration = self.choice(Calibration, "Calibration", optional=True)
        self.white = self.choice(RawImage, "White image", optional=True)
        self.camera = FileEdit(label="Camera file", filter="*.toml", nullable=True)
        self.named = LineEdit(label="or of the catalogue")
        self.first = FloatSpinBox(value=0, min=-1e6, max=1e6, step=1, label="First depth [µm]")
        self.last = FloatSpinBox(value=0, min=-1e6, max=1e6, step=1, label="Last depth [µm]")
        self.planes = SpinBox(value=1, min=1, max=1000, label="Planes")
        self.iterations = SpinBox(value=10, min=1, max=1000, label="Iterations")
        self.faster = CheckBox(value=False, text="Accelerated")
        super().__init__(
            napari_viewer,
            [
                self.raw, self.calibration, self.white, self.camera, self.named, self.first, self.last,
                self.planes, self.iterations, self.faster,
            ],
            "Deconvolve",
        )  # fmt: skip

    def job(self) -> Job:
        """An object, and how it was reached."""
        raw, camera = chosen(self.raw, RawImage, "a raw image"), load_camera(self._described())
        given = self.calibration.value and chosen(self.calibration, Calibration, "a calibration")
        white = self.white.value and chosen(self.white, RawImage, "a white image")
        depths, iterations, faster = self._depths(), self.iterations.value, self.faster.value

        def work(tell: Progress) -> tuple[Any, str]:
            tell(Stage(0.0, "preparing"))
            ready = prepare(raw, given, white=white, camera=camera, divide=False)
            operator = camera.operator_for(ready.calibration, depths, None, within(tell, 0, _MODEL, "model"))
            method = RichardsonLucy(None, low_pass_of(camera, operator), accelerated=faster)
            reached = 0

            def follow(step: RunStep) -> None:
                nonlocal reached
                if step.announces:
                    tell(Stage(_MODEL, f"about {step.remaining:.0f} s"))
                    return
                reached, part = step.iteration, step.iteration / step.iterations
                what = f"iteration {reached}, the last changed {100 * step.change:.2g} %"
                tell(Stage(_MODEL + (1 - _MODEL) * part, what))

            try:
                found = deconvolve(ready, operator, iterations, method=method, progress=follow)
            except Interrupted as stopped:
                return stopped.partial, f"stopped after {stopped.iterations} iterations"
            return found, f"{reached} iterations"

        return work

    def take(self, found: tuple[Any, str]) -> str:
        """The object beside the raw image."""
        thing, how = found
        self.put(layer_of(thing, "reconstruction"))
        return f"{' × '.join(map(str, thing.data.shape))} samples, {how}"

    def _described(self) -> Path | str:
        path = self.camera.value
        if path is not None and Path(path).is_file():
            return Path(path)
        if not self.named.value:
            raise LumigraphError("no camera is given. Choose its file (TOML), or name one of the catalogue.")
        return self.named.value

    def _depths(self) -> tuple[float, ...] | None:
        first, last, count = self.first.value, self.last.value, self.planes.value
        if count == 1:
            return None if first == last == 0 else (first * um,)
        if last <= first:
            raise LumigraphError(
                f"the last of {count} depths is {last:g} µm but must be above the first, {first:g} µm."
            )
        return tuple(float(dz) for dz in np.linspace(first, last, count) * um)
