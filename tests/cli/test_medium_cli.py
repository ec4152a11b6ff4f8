"""`lumigraph simulate --medium`: a scene seen through a volume of refractive indices."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.units import um

CAMERA = """
kind = "light-field-microscope"
wavelength = "525 nm"
[objective]
magnification = 20.0
numerical_aperture = 0.15
[lenslets]
pitch = "125 um"
focal_length = "5 mm"
count = [3, 3]
[sensor]
pixel_pitch = "12.5 um"
"""


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Media that reach the simulation."""
    (tmp_path / "scope.toml").write_text(CAMERA)
    grid = lg.Grid.square(8, 2 * um)
    index = np.full((3, 8, 8), 1.02, np.float32)
    lg.save(lg.Volume(index, grid, (-4 * um, -2 * um, 0.0)), tmp_path / "index.zarr")
    lg.save(lg.RawImage(index[0], 1e-6), tmp_path / "flat.tiff")
    media = []

    def simulate(camera, _scene, *_, medium=None, **__):
        media.append(medium)
        return lg.RawImage(np.ones(camera.sensor.shape, np.float32), 12.5e-6)

    monkeypatch.setattr("lumigraph.simulation.simulate", simulate)
    return media


SCENE = ("simulate", "scope.toml", "--point", "0 um, 0 um, 5 um", "-o", "out.tiff")


def test_a_volume_of_indices_reaches_the_simulation(lumigraph, made):
    moved = ("--medium-depth", "-10 um", "--medium-index", "absolute")
    for words in (("--medium", "index.zarr"), ("--medium", "index.zarr", *moved), ()):
        result = lumigraph(*SCENE, *words)
        assert (result.code, result.err) == (0, "")
    difference, absolute, none = made
    assert none is None
    assert difference.slabs
    np.testing.assert_allclose(difference.paths, 1.02 * 2e-6, rtol=1e-6)
    np.testing.assert_allclose(absolute.paths, 0.02 * 2e-6, rtol=1e-5)
    np.testing.assert_allclose(absolute.depths, np.array(difference.depths) - 10e-6)


@pytest.mark.usefixtures("made")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--medium-index", "absolute"), "have no meaning without --medium"),
        (("--medium", "flat.tiff"), "holds a RawImage but must be a volume"),
        (("--medium", "none.zarr"), "none.zarr"),
    ],
)
def test_media_that_are_none_are_refused(lumigraph, words, message):
    result = lumigraph(*SCENE, *words)
    assert (result.code, result.out) == (1, "")
    assert message in result.err
