# pyright: reportMissingImports=false
"""Common parts of the widgets: choices of layers, a button, progress, and the result."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from magicgui.widgets import ComboBox, Container, Label, ProgressBar, PushButton
from napari.layers import Layer
from napari.utils.notifications import show_error

from lumigraph.core.layers import LayerData
from lumigraph.errors import LumigraphError
from lumigraph.napari.shown import held
from lumigraph.napari.work import Job, Work

_PARTS = 1000


class Panel(Container):
    """Controls of one verb, a button that starts it, another that stops it, and its progress.

    Parameters
    ----------
    viewer
        napari's.
    controls
        Above the buttons.
    verb
        What the button says.
    """

    def __init__(self, viewer: Any, controls: Sequence[Any], verb: str) -> None:
        self.viewer = viewer
        self.start_button = PushButton(text=verb)
        self.stop_button = PushButton(text="Stop", enabled=False)
        self.bar = ProgressBar(min=0, max=_PARTS, value=0, visible=False, label="Progress")
        self.said = Label(value="")
        super().__init__(
            widgets=[*controls, self.start_button, self.stop_button, self.bar, self.said], labels=True
        )
        self.work = Work(self._done, self._failed, self._shown)
        self.start_button.changed.connect(lambda: self.start())
        self.stop_button.changed.connect(lambda: self.work.stop())
        for event in (viewer.layers.events.inserted, viewer.layers.events.removed):
            event.connect(self._refresh)

    def job(self) -> Job:
        """Job to compute, by the controls; called in the main thread."""
        raise NotImplementedError  # each verb's panel has its own

    def take(self, found: Any) -> str:
        """Show the result, and summarise it in a line."""
        raise NotImplementedError  # each verb's panel has its own

    def start(self) -> None:
        """Compute, unless a computation is running; wrong controls are reported at once."""
        if self.work.is_running:
            return
        try:
            job = self.job()
        except LumigraphError as error:
            self._failed(error)
            return
        self._busy(True)
        self.work.start(job)

    def choice(self, kind: type, label: str, *, optional: bool = False) -> ComboBox:
        """A choice among the layers that hold a kind of noun."""

        def choices(_: Any) -> list[tuple[str, Any]]:
            found = [(layer.name, layer) for layer in self.viewer.layers if held(layer, kind) is not None]
            return [("none", None), *found] if optional else found

        return ComboBox(choices=choices, label=label, nullable=optional)

    def put(self, layer: LayerData) -> None:
        """Show a layer in the place of the one of its name, or as a new one."""
        data, options, kind = layer
        name = options["name"]
        old = next((each for each in self.viewer.layers if each.name == name), None)
        if old is not None and np.shape(old.data) == np.shape(data) and type(old).__name__.lower() == kind:
            old.data, old.metadata = data, options["metadata"]
            return
        if old is not None:
            self.viewer.layers.remove(old)
        self.viewer.add_layer(Layer.create(data, options, kind))

    def _refresh(self, _: Any = None) -> None:
        for widget in self:
            if isinstance(widget, ComboBox):
                widget.reset_choices()

    def _busy(self, on: bool) -> None:
        self.start_button.enabled, self.stop_button.enabled, self.bar.visible = not on, on, on
        if on:
            self.bar.value, self.said.value = 0, ""

    def _shown(self, fraction: float, what: str) -> None:
        self.bar.value = round(_PARTS * min(max(fraction, 0.0), 1.0))
        self.said.value = what

    def _done(self, found: Any) -> None:
        self._busy(False)
        self.said.value = "Stopped." if found is None else self.take(found)

    def _failed(self, error: BaseException) -> None:
        self._busy(False)
        self.said.value = str(error)
        show_error(str(error))


def chosen(box: ComboBox, kind: type, what: str) -> Any:
    """Noun that the chosen layer holds.

    Raises
    ------
    LumigraphError
        Nothing is chosen, or it is gone.
    """
    found = None if box.value is None else held(box.value, kind)
    if found is None:
        raise LumigraphError(f"no layer holds {what}. Open one, or compute it by another widget first.")
    return found
