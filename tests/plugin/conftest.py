"""The plugin's tests run where napari is installed: `.ci/napari` puts it beside the other packages."""

import os

import pytest

SHOWN = bool(os.environ.get("DISPLAY"))
if not SHOWN:
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture(autouse=True, scope="session")
def _napari():
    pytest.importorskip("napari.layers", reason="napari is not installed: pip install lumigraph[napari]")


@pytest.fixture
def window(request):
    """napari's own viewer in a window, which needs OpenGL."""
    if not SHOWN:
        pytest.skip("no display with OpenGL: run it under xvfb-run")
    return request.getfixturevalue("make_napari_viewer")(show=True)


@pytest.fixture
def viewer(qtbot):
    """napari's viewer without its window."""
    from napari.components import ViewerModel

    return ViewerModel()
