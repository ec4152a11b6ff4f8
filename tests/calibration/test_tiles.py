"""Large pictures, made small: calibrated in tiles, against the lattice that they were drawn from."""

import numpy as np
import pytest

from calibration_drawing import white
from lumigraph.calibration import calibrate, centres, lattice_fit, tiles
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """What is large, and how large its middle and its tiles are."""
    monkeypatch.setattr(lattice_fit, "LARGEST", 300)
    for name, size in (("_MIDDLE", 192), ("_TILE", 170), ("_PROBE", 80)):
        monkeypatch.setattr(tiles, name, size)


def off(found, truth):
    """Largest distance of a true centre from the nearest one of a calibration [px]."""
    return float(np.hypot(*np.array(found.offset(*truth.T))).max())


@pytest.mark.parametrize("layout", ["square", "hex"])
def test_tiles_find_the_lattice_that_the_whole_picture_has(layout, rng, monkeypatch):
    lattice = getattr(Lattice, layout)(11.3, 0.031, (4.0, 5.0))
    picture, centers = white(lattice, (400, 380), fill=0.85, noise=0.03, vignetting=0.5, rng=rng)
    found = calibrate(picture)
    assert found.lattice.layout == layout
    assert off(found, centers) < 0.02
    monkeypatch.setattr(lattice_fit, "LARGEST", 1000)
    whole = calibrate(picture)
    assert len(found.centers) == pytest.approx(len(whole.centers), abs=4)
    assert found.residual_px == pytest.approx(whole.residual_px, rel=0.1)
    assert found.fill == pytest.approx(whole.fill, abs=0.02)


def test_distortion_is_followed_from_tile_to_tile(rng):
    """Half a pitch at the corners, which the middle does not know of."""
    warp = Warp((260.0, 260.0), (3e-5, 0.0), 1.1e-7)
    picture, centers = white(Lattice.square(10.2, 0.02, (3, 4)), (520, 520), warp=warp, noise=0.02, rng=rng)
    found = calibrate(picture)
    assert warp.largest((520, 520)) > 5
    assert off(found, centers) < 0.1


def test_a_dead_lenslet_is_missing_in_a_large_picture_too(rng):
    lattice = Lattice.square(12.0, 0.0, (5.5, 5.5))
    picture = white(lattice, (400, 400), rng=rng)[0]
    dy, dx = lattice.offset(*np.mgrid[:400, :400])
    y, x = np.mgrid[:400, :400]
    picture[(np.hypot(y - 353.5, x - 53.5) < 8) & (np.abs(dy) < 6) & (np.abs(dx) < 6)] = 0
    found = calibrate(picture)
    np.testing.assert_allclose(found.position(found.missing), [(353.5, 53.5)], atol=0.1)


def test_a_quarter_without_the_lattice_is_refused(rng):
    picture = white(Lattice.square(11.3, 0.02, (4, 5)), (500, 500), noise=0.02, rng=rng)[0]
    dark = picture.copy()
    dark[255:, 255:] = 0.02 * rng.standard_normal((245, 245))
    with pytest.raises(CalibrationError, match="were found in a quarter of the picture"):
        calibrate(dark)
    picture[255:, :245] = white(Lattice.square(11.9, -0.04, (4, 5)), (245, 245), rng=rng)[0]
    with pytest.raises(CalibrationError, match=r"quarters? of the picture"):
        calibrate(picture)


@pytest.mark.parametrize("pitch", [11.4, 11.9])
def test_a_quarter_with_another_lattice_is_refused_in_a_small_picture_too(pitch, rng):
    picture = white(Lattice.square(11.3, 0.02, (4, 5)), (280, 280), noise=0.02, rng=rng)[0]
    picture[145:, 145:] = white(Lattice.square(pitch, -0.04, (4, 9)), (135, 135), rng=rng)[0]
    with pytest.raises(CalibrationError, match=r"quarters? of the picture"):
        calibrate(picture)


def test_a_large_picture_without_a_measured_centre_is_refused(rng, monkeypatch):
    picture = white(Lattice.square(11.3, 0.02, (4, 5)), (400, 400), rng=rng)[0]
    unmeasured = tiles.whole(picture, tiles.Request())._replace(how="nothing")
    monkeypatch.setattr(tiles, "whole", lambda *_: unmeasured)
    with pytest.raises(CalibrationError, match="no centre could be measured"):
        calibrate(picture)


@pytest.mark.parametrize("pitch", [5.9, 9.1, 17.2])
def test_a_single_round_leaves_out_only_pixels_without_weight(pitch, monkeypatch, rng):
    lattice, shape = Lattice.square(pitch, 0.03, (100.3, 99.8)), (200, 210)
    picture = (white(lattice, shape)[0] + 0.05 * rng.standard_normal(shape)).astype(np.float32)
    none = np.zeros((0, 2), np.int64)
    model = Calibration(lattice, shape, none, none.astype(float), 0.0)
    found = centres.measured(picture, model, rounds=1)
    reach = centres._reach
    monkeypatch.setattr(centres, "_reach", lambda size, rounds: reach(size, rounds) + 3)
    wider = centres.measured(picture, model, rounds=1)
    np.testing.assert_allclose(found.centers, wider.centers, atol=1e-5)
    np.testing.assert_allclose(found.light, wider.light, rtol=1e-5, atol=1e-5)
