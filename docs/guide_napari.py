"""The picture of docs/how-to/napari.md: napari with the sample scene and the widget that refocuses.

Run, where napari is installed, on a screen such as that of xvfb-run: python docs/guide_napari.py
"""

import time
from pathlib import Path

import napari
from guide_reports import GUIDES, keep
from qtpy.QtWidgets import QApplication

import lumigraph as lg


def main() -> None:
    """Open the viewer, wait until it is drawn, and keep what it shows."""
    viewer = napari.Viewer()
    viewer.window.resize(1200, 760)
    data, options, _ = lg.samples.scene((240, 320)).views.to_napari("robot")
    viewer.add_image(data, **options)
    viewer.window.add_plugin_dock_widget("lumigraph", "Refocus")
    end = time.monotonic() + 8
    while time.monotonic() < end:
        QApplication.processEvents()
        time.sleep(0.02)
    path = Path(GUIDES / "napari.png")
    viewer.screenshot(path, canvas_only=False, flash=False)
    viewer.close()
    keep(path.read_bytes(), "napari")


if __name__ == "__main__":
    main()
