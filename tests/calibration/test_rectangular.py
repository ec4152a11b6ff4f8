"""Lattices of two pitches, and arrays of lenslets that repeat in one direction only."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import io
from lumigraph.calibration import calibrate, exactly
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError, GeometryError

SHAPE = (300, 380)


def drawn(lattice, form="disc", noise=0.0):
    """White image of discs, or of ellipses or boxes that fill the cells."""
    dy, dx = lattice.offset(np.arange(float(SHAPE[0]))[:, None], np.arange(float(SHAPE[1])))
    down, along = lattice.pitches
    cos, sin = np.cos(lattice.rotation), np.sin(lattice.rotation)
    v, u = dy * cos - dx * sin, dx * cos + dy * sin
    if form == "disc":
        beyond = np.hypot(u, v) - 0.43 * min(down, along)
    elif form == "ellipse":
        beyond = (np.hypot(v / down, u / along) - 0.43) * (down + along) / 2
    else:
        beyond = np.maximum(np.abs(v) - 0.42 * down, np.abs(u) - 0.42 * along)
    light = 1 / (1 + np.exp(np.clip(beyond / 0.8, -50, 50)))
    return light + noise * np.random.default_rng(0).standard_normal(SHAPE)


def off(found, lattice):
    """Largest distance of a true centre from the fit [px]."""
    true = lattice.centers((12, SHAPE[0] - 13), (12, SHAPE[1] - 13))
    return float(np.hypot(*np.array(found.offset(*true.T))).max())


@pytest.mark.parametrize(
    ("pitches", "rotation", "form", "noise"),
    [
        ((14.3, 18.0), 0.0, "disc", 0.0),  # found as a square lattice of 11.5 px at -38 degrees
        ((20.0, 30.0), 0.0, "disc", 0.0),
        ((15.2, 30.4), 0.0, "disc", 0.03),
        ((26.7, 19.4), -0.7, "ellipse", 0.03),
        ((12.1, 8.5), 0.0, "box", 0.03),
        ((11.0, 33.0), 0.35, "ellipse", 0.0),
        ((19.8, 18.5), 0.02, "disc", 0.05),
    ],
)
def test_rectangular_lattices_are_found_as_they_are(pitches, rotation, form, noise):
    lattice = Lattice.rectangular(pitches, rotation, (150.3, 190.7))
    found = calibrate(drawn(lattice, form, noise))
    assert found.lattice.layout == "rectangular"
    assert found.lattice.cell_area == pytest.approx(lattice.cell_area, rel=2e-3)
    assert off(found, lattice) < 0.1  # whole pixels repeat after one cell: all have the same error
    assert len(found.missing) == 0


def test_a_rectangular_lattice_is_no_square_one_and_has_no_exact_pitch():
    found = calibrate(drawn(Lattice.rectangular((14.3, 18.0), 0.0, (150.3, 190.7))))
    with pytest.raises(CalibrationError, match=r"rectangular lattice of 14\.30 x 18\.00 px"):
        exactly(found, 16)
    with pytest.raises(CalibrationError):
        calibrate(drawn(Lattice.rectangular((14.3, 20.0), 0.0, (150.3, 190.7))), layout="square")


def test_a_square_lattice_is_not_called_rectangular():
    assert calibrate(drawn(Lattice.square(16.2, 0.02, (150, 190)), noise=0.05)).lattice.layout == "square"
    with pytest.raises(CalibrationError, match="no lattice of layout 'rectangular'"):
        calibrate(drawn(Lattice.square(16.2, 0.02, (150, 190))), layout="rectangular")


def test_a_rectangular_calibration_survives_its_file(tmp_path):
    found = calibrate(drawn(Lattice.rectangular((14.3, 18.0), 0.0, (150.3, 190.7))))
    io.save(found, tmp_path / "lattice.toml")
    assert io.load_calibration(tmp_path / "lattice.toml").lattice == found.lattice


def test_views_behind_rectangular_lenslets_show_the_scene_and_refocus_alike_on_both_axes():
    """A point scene whose light moves with direction: each view is the scene moved by its own way."""
    lattice = Lattice.rectangular((14.0, 20.0), 0.0, (150.0, 190.0))
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    i, j = lattice.index(y, x)
    dy, dx = lattice.offset(y, x)
    slope = 0.4  # of a pixel's way through the scene [px] for each pixel of direction

    def scene(down, across):
        return 1 + 0.5 * np.sin(2 * np.pi * down / 90) + 0.4 * np.sin(2 * np.pi * across / 110 + 1)

    raw = scene(14 * i + slope * dy, 20 * j + slope * dx)
    found = calibrate(drawn(lattice, "box"))
    views = lg.decode(raw.astype(np.float32), found)
    t, s = (np.arange(n) - n // 2 for n in views.data.shape[2:])
    nv, nu = views.data.shape[:2]
    assert (nv, nu) == (14, 20)
    for v, u in ((nv // 2, nu // 2), (nv // 2 - 4, nu // 2 + 5)):
        expected = scene(14 * t[:, None] - slope * (v - nv // 2), 20 * s - slope * (u - nu // 2))
        np.testing.assert_allclose(views.data[v, u], expected, atol=0.02)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_cylindrical_lenslets_are_refused_by_name(angle, noise):
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    away = np.abs((np.cos(angle) * x + np.sin(angle) * y + 7) % 17.3 - 8.65)
    light = (1 - 0.2 * ((x / 190 - 1) ** 2 + (y / 150 - 1) ** 2)) / (1 + np.exp((away - 7) / 0.8))
    light += noise * np.random.default_rng(1).standard_normal(SHAPE)
    with pytest.raises(CalibrationError, match=r"one-dimensional \(cylindrical\) lens array: .* 17\.[123]"):
        calibrate(light)


def test_pitches_of_a_rectangular_lattice_must_be_above_zero():
    with pytest.raises(GeometryError, match="pitches"):
        Lattice.rectangular((14.0, -3.0))
