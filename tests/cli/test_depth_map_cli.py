"""`lumigraph simulate --depth-map`: a picture with depths as opaque slices."""

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.core.raw import RawImage


@pytest.fixture
def made(bench, monkeypatch):
    """Scenes that reach the simulation."""
    scenes, known = [], io.open
    depth = np.full((40, 40), 4e-3, np.float32)
    depth[10:30, 10:30] = -2e-3
    io.save(RawImage(depth, 1e-6), bench / "depth.pfm")
    io.save(RawImage(np.where(depth < 0, 255, 0).astype(np.uint8), 1e-6), bench / "depth.png")
    raw = known(bench / "raw.tiff")

    def simulate(_camera, scene, *_, **__):
        scenes.append(scene)
        return raw

    monkeypatch.setattr("lumigraph.simulation.simulate", simulate)
    return scenes


PICTURE = ("simulate", "camera.toml", "--scene", "siemens_star", "-o", "out.tiff")


@pytest.mark.parametrize(
    "words",
    [("--depth-map", "depth.pfm"), ("--depth-map", "depth.png", "--depth", "-2 mm", "--depth", "4 mm")],
)
def test_a_picture_with_depths_is_opaque_slices(lumigraph, made, words):
    result = lumigraph(*PICTURE, *words, "--planes", 2, "--point", "0 mm, 0 mm, 1 mm")
    assert (result.code, result.err) == (0, "")
    far, near, point = made[0].parts
    assert far.hides
    assert near.hides
    np.testing.assert_allclose([far.dz, near.dz, point.positions[0, 2]], [4e-3, -2e-3, 1e-3], atol=1e-7)
    assert near.opacity.mean() == pytest.approx(0.25, abs=0.02)


@pytest.mark.usefixtures("made")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--planes", 3), "--planes has no meaning without --depth-map"),
        (("--depth-map", "depth.png"), "holds whole numbers, not metres"),
        (("--depth-map", "depth.pfm", "--depth", "1 mm"), "takes 2 --depth"),
        (("--depth-map", "depth.pfm", "--scene", "edge"), "of one --scene, not 2"),
        (("--depth-map", "none.pfm"), "none.pfm"),
    ],
)
def test_depth_maps_that_mean_nothing_are_refused(lumigraph, words, message):
    result = lumigraph(*PICTURE, *words)
    assert (result.code, result.out) == (1, "")
    assert message in result.err
