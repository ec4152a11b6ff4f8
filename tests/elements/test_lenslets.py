import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.elements import LensletArray
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.propagation import propagate
from lumigraph.scene.sources import plane_wave

WAVELENGTH, PITCH, FOCAL = 633e-9, 150e-6, 5.2e-3
GRID = Grid((192, 201), (5e-6, 5e-6))


FINE = Grid.square(500, 2e-6)


def focal_image(tilt):
    """Intensity in the focal plane of 3 × 3 lenslets."""
    array = LensletArray(Lattice.square(PITCH), FOCAL, extent=(3 * PITCH, 3 * PITCH))
    wave = array(plane_wave(FINE, WAVELENGTH, tilt))
    return propagate(wave, FOCAL, "band_limited", pad=1.0).intensity


@pytest.mark.parametrize("samples", [(8, 0), (-7, 13)])
def test_a_tilted_wave_moves_every_spot_by_f_tan_angle(samples):
    # A paraxial identity for the whole pattern; at 6 mrad 2e-3 of the peak are left of it,
    # while a pattern moved by a tenth of a sample differs by 1e-2.
    tilt = tuple(math.atan(n * 2e-6 / FOCAL) for n in samples)
    moved, still = focal_image(tilt), focal_image((0.0, 0.0))
    np.testing.assert_allclose(moved, np.roll(still, samples, (0, 1)), atol=3e-3 * still.max())


def test_spots_stand_at_the_lattice():
    # Sidelobes of the neighbours interfere, which draws outer spots in by 0.8 um.
    image = focal_image((0.0, 0.0))
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            y, x = 250 + 75 * i, 250 + 75 * j
            part = image[y - 7 : y + 8, x - 7 : x + 8]
            assert np.average(np.arange(-7, 8) * 2e-6, weights=part.sum(1)) == pytest.approx(0, abs=1e-6)
            assert np.average(np.arange(-7, 8) * 2e-6, weights=part.sum(0)) == pytest.approx(0, abs=1e-6)
            assert part.max() > 0.8 * image.max()


@pytest.mark.parametrize("rotation", [0.0, 0.2])
@pytest.mark.parametrize("fill", [1.0, 0.937, 0.5])
def test_square_lenslets_are_open_over_their_exact_area(rotation, fill):
    lattice = Lattice.square(PITCH, rotation, origin=(7e-6, -3e-6))
    array = LensletArray(lattice, FOCAL, fill_factor=fill, extent=(3.1 * PITCH, 3.1 * PITCH))
    area = np.abs(array.transmission(GRID, WAVELENGTH)).sum() * 25e-12
    # Exact along the axes; the corners of turned squares are approximated.
    assert area == pytest.approx(9 * (fill * PITCH) ** 2, rel=1e-9 if rotation == 0 else 2e-4)


def test_round_lenslets_are_open_over_their_exact_area():
    array = LensletArray(
        Lattice.hex(PITCH, 0.3), FOCAL, shape="round", fill_factor=0.9, extent=(2.1 * PITCH, 2.1 * PITCH)
    )
    area = np.abs(array.transmission(GRID, WAVELENGTH)).sum() * 25e-12
    assert area == pytest.approx(7 * math.pi * (0.45 * PITCH) ** 2, rel=1e-9)


def test_hexagonal_lenslets_are_open_over_their_cells():
    array = LensletArray(Lattice.hex(PITCH, 0.1), FOCAL, fill_factor=0.8, extent=(2.1 * PITCH, 2.1 * PITCH))
    area = np.abs(array.transmission(GRID, WAVELENGTH)).sum() * 25e-12
    assert area == pytest.approx(7 * 0.64 * math.sqrt(3) / 2 * PITCH**2, rel=2e-3)


@pytest.mark.parametrize(
    "lattice", [Lattice.square(PITCH, 0.1), Lattice.hex(PITCH, 0.1), Lattice.square(PITCH)]
)
@pytest.mark.parametrize("extent", [None, (1.0, 1.0)])
def test_abutting_lenslets_leave_no_seam(lattice, extent):
    factor = LensletArray(lattice, FOCAL, extent=extent).transmission(GRID, WAVELENGTH)
    np.testing.assert_allclose(np.abs(factor), 1.0, atol=1e-12)


@pytest.mark.parametrize("edge", ["grey", "hard"])
@pytest.mark.parametrize("fill", [1.0, 0.93])
def test_the_product_along_the_axes_equals_the_general_way(edge, fill):
    def array(rotation):
        lattice = Lattice.square(PITCH, rotation, origin=(6e-6, -2e-6))
        return LensletArray(lattice, FOCAL, fill_factor=fill, extent=(3 * PITCH, 5 * PITCH), edge=edge)

    straight, turned = (array(angle).transmission(GRID, WAVELENGTH) for angle in (0.0, 1e-13))
    np.testing.assert_allclose(straight, turned, atol=1e-9)


def test_the_extent_turns_with_the_lattice():
    lattice = Lattice.square(PITCH, 0.3)
    factor = LensletArray(lattice, FOCAL, extent=(1.1 * PITCH, 3.1 * PITCH)).transmission(GRID, WAVELENGTH)
    open_at = np.abs(factor) > 0.5
    for j, expected in ((-1, True), (1, True), (2, False)):
        y, x = lattice.position([0, j])
        assert open_at[np.argmin(abs(GRID.y - y)), np.argmin(abs(GRID.x - x))] == expected
    y, x = lattice.position([1, 0])
    assert not open_at[np.argmin(abs(GRID.y - y)), np.argmin(abs(GRID.x - x))]


def test_three_kinds_have_three_focal_lengths():
    lattice = Lattice.hex(PITCH, kinds=3)
    focal = (4e-3, 5e-3, 7e-3)
    factor = LensletArray(lattice, focal).transmission(GRID, WAVELENGTH)
    for j in range(3):
        y, x = lattice.position([0, j])
        row, column = np.argmin(abs(GRID.y - y)), np.argmin(abs(GRID.x - x))
        step = GRID.x[column + 4] - x
        rise = np.angle(factor[row, column + 4] / factor[row, column])
        expected = -math.pi * (step**2 - (GRID.x[column] - x) ** 2) / (WAVELENGTH * focal[lattice.kind(0, j)])
        assert rise == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", ["complex64", "complex128"])
def test_lenslets_keep_library_and_precision(xp, name):
    data = xp.asarray(np.ones(GRID.shape, name))
    array = LensletArray(Lattice.hex(PITCH), FOCAL)
    result = array(Field(data, GRID, WAVELENGTH)).data
    assert isinstance(result, type(data))
    assert str(result.dtype).endswith(name)
    np.testing.assert_allclose(to_numpy(result), array.transmission(GRID, WAVELENGTH), atol=1e-7)


def test_a_coarse_grid_warns_with_numbers():
    # λf/p = 21.9 um.
    wave = plane_wave(Grid.square(40, 25e-6), WAVELENGTH)
    with pytest.warns(SamplingWarning, match=r"a lenslet of f = 5\.2 mm .* samples 25 µm .* needs 21\.94 µm"):
        LensletArray(Lattice.square(PITCH), FOCAL)(wave)
    LensletArray(Lattice.square(PITCH), FOCAL)(plane_wave(Grid.square(40, 21e-6), WAVELENGTH))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: LensletArray(Lattice.square(PITCH), 0.0), "focal_length is 0 m"),
        (
            lambda: LensletArray(Lattice.hex(PITCH), (1.0, 2.0, 3.0)),
            "3 focal lengths .* lattice of 1 kind. Give",
        ),
        (lambda: LensletArray(Lattice.hex(PITCH, kinds=3), (1.0, 2.0)), "2 focal lengths .* of 3 kinds"),
        (
            lambda: LensletArray(Lattice.square(PITCH), 1.0, shape="hex"),
            "shape is 'hex' but lenslets on a 'square'",
        ),
        (
            lambda: LensletArray(Lattice.square(PITCH), 1.0, fill_factor=1.1),
            "fill_factor is 1.1 but lenslets overlap",
        ),
        (
            lambda: LensletArray(Lattice.square(PITCH), 1.0, fill_factor=0.0),
            "fill_factor is 0 but must be above",
        ),
        (lambda: LensletArray(Lattice.square(PITCH), 1.0, extent=(1.0, 0.0)), r"extent \(width\) is 0 m"),
        (lambda: LensletArray(Lattice.square(PITCH), 1.0, edge="soft"), "edge is 'soft'"),
    ],
)
def test_impossible_lenslets_are_refused(build, message):
    with pytest.raises(GeometryError, match=message):
        build()
