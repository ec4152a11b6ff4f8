"""What lenslets make of light near a cell: band-limited light, and the Fresnel integral by FFT."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.elements import LensletArray
from lumigraph.operators.lenslets.cell_response import CellLenslets, legendre, nodes
from lumigraph.operators.lenslets.lenslet_light import LensletLight, windows
from lumigraph.operators.sampling.cell_axis import INFINITE, SLACK, CellAxis
from lumigraph.operators.sampling.cells import OVERSAMPLING
from lumigraph.propagation import propagate
from lumigraph.units import mm, nm, um

WAVELENGTH, DISTANCE, PITCH = 633 * nm, 4 * mm, 100 * um
BAND = 4.5e4


def axis(size=PITCH, samples=40, neighbours=2):
    return CellAxis(size, 2 * math.ceil(size * BAND * 2.9), samples, neighbours * PITCH, BAND)


def test_samples_of_light_tell_what_is_between_them():
    """Waves up to 0.95 of the band, over the cell and its neighbourhood, to 1e-5 of their amplitude.

    Nearest samples, or a sinc series cut off at the window, are wrong by more than a tenth.
    """
    here = axis()
    coefficients, values = here.basis()
    at = np.linspace(-1, 1, 301) * (here.size / 2 + here.neighbourhood - PITCH / 2)  # the rest fades
    for frequency in (0.0, 0.3 * BAND, -0.95 * BAND):
        found = values(at) @ (coefficients @ np.exp(2j * np.pi * frequency * here.window))
        np.testing.assert_allclose(found, np.exp(2j * np.pi * frequency * at), atol=1e-5)


@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5])
def test_light_around_a_lenslet_tells_what_is_in_it(accuracy):
    """Waves up to the edge of the main lens, from points that stand as far apart as they may.

    Their images are off by less: most of it is at the lenslet's edge, and of waves from the stop's edge.
    """
    band = 6 / (4 * PITCH) * SLACK / OVERSAMPLING
    plain = CellAxis(PITCH, 6, 10, 0.0, band)
    _, here = windows(CellLenslets((plain, plain), ARRAYS["hexagonal"], WAVELENGTH, DISTANCE), accuracy)
    coefficients, values = here.basis()
    at, edge = np.linspace(-PITCH / 2, PITCH / 2, 201), band / SLACK
    frequencies = np.linspace(-edge, edge, 25)
    waves = np.exp(2j * np.pi * frequencies * here.window[:, None])
    off = values(at) @ (coefficients @ waves) - np.exp(2j * np.pi * frequencies * at[:, None])
    assert np.sqrt(np.mean(np.abs(off) ** 2)) < 3 * accuracy


def test_the_window_and_the_image_are_centred_on_the_cell():
    here = CellAxis(1.0, 4, 5, 1.5, 1.0)
    np.testing.assert_allclose(here.image, [-0.4, -0.2, 0, 0.2, 0.4], atol=1e-15)
    assert here.margin == 6
    np.testing.assert_allclose(here.window, np.arange(-6, 10, 2) / 4 + 0.125 - 0.5)


def test_light_fades_over_the_last_pitch():
    here = axis()
    ends = here.size / 2 + here.neighbourhood
    at = np.array([0, ends - PITCH, ends - PITCH / 2, ends, 2 * ends, PITCH / 2 - ends])
    np.testing.assert_allclose(here.fade(at, PITCH), [1, 1, 0.5, 0, 0, 0.5], atol=1e-12)


def test_quadrature_is_exact_for_what_a_lenslet_turns():
    """A chirp across a lenslet with the nodes that are taken, against ten times as many."""
    half, f = PITCH / 2, 3 * mm
    few = nodes(half, f, axis(), (WAVELENGTH, DISTANCE))

    def integral(count):
        x, weight = legendre(-half, half, count)
        phase = -(x**2) / f + (x - 2.5 * PITCH) ** 2 / DISTANCE
        return weight @ np.exp(1j * np.pi * phase / WAVELENGTH)

    assert abs(integral(few) - integral(10 * few)) < 1e-10 * PITCH
    assert few < 60


def light(y, x):
    """Two beams off the axis, tilted: no symmetry; their spectra end within the band, to 1e-5."""
    first = np.exp(-(((y - 20 * um) / (32 * um)) ** 2) - ((x + 25 * um) / (40 * um)) ** 2)
    second = np.exp(-(((y + 30 * um) / (36 * um)) ** 2) - ((x - 10 * um) / (32 * um)) ** 2)
    return first * np.exp(4e4j * x) + 0.7j * second * np.exp(-3e4j * y)


def image_of(array, axes, center, limits=(INFINITE, INFINITE)):
    """Field (y, x) on the samples of a cell, by `CellLenslets` or lenslet by lenslet."""
    lenslets = CellLenslets(axes, array, WAVELENGTH, DISTANCE)
    if array.shape != "square":
        return one_by_one(lenslets, center, limits)
    y, x = (c + a.window for c, a in zip(center, axes, strict=True))
    found = lenslets.response(center, limits)
    return found.down[0] @ light(y[:, None], x) @ found.across[0].T


def one_by_one(lenslets, center, limits):
    """The sum over the lenslets by `LensletLight`, with the phase that it leaves out."""
    one, axes = LensletLight(lenslets, None, 0.0, 1e-4), lenslets.axes
    (down, _), (across, _) = one.bases
    field = np.zeros((axes[0].samples, axes[1].samples), complex)
    for place, members in lenslets.rows(center, limits):
        for x, focal_length in members:
            at = [c + p + a.window for c, p, a in zip(center, (place, x), one.window, strict=True)]
            around = (down @ light(at[0][:, None], at[1]) @ across.T).ravel()
            few = np.linalg.multi_dot([around, one.kept, *one.matrices(place, x, focal_length)])
            field += one.carried(0, place) @ few.reshape(one.modes[0].shape[1], -1) @ one.carried(1, x).T
    phase = (np.exp(1j * np.pi * a.image**2 / (WAVELENGTH * DISTANCE)) for a in axes)
    return field * np.outer(*phase)


def propagated(array, axes, center):
    """The same by a sum over a fine grid, the Fresnel integral as a matrix DFT, with grey edges."""
    grid = Grid((500, 500), 1 * um, (0.5 * um, 0.5 * um))
    field = Field(light(grid.y[:, None], grid.x), grid, WAVELENGTH)
    steps = [a.size / a.samples for a in axes]
    middle = [c + a.image[a.samples // 2] for c, a in zip(center, axes, strict=True)]
    seen = Grid((axes[0].samples, axes[1].samples), (steps[0], steps[1]), (middle[0], middle[1]))
    return propagate(array(field), DISTANCE, "fresnel", grid=seen).data


def assert_same(found, expected):
    """But for the carrier exp(ikz), which no image shows.

    1 um samples with grey edges are right to some 1e-3 of the brightest; a lenslet more or less, or one of
    another kind, gives thirty times as much.
    """
    ratio = np.vdot(found, expected)
    difference = np.abs(found - expected * np.conj(ratio) / abs(ratio))
    assert difference.max() < 3e-3 * np.abs(expected).max()


SQUARE, HEX = Lattice.square(PITCH), Lattice.hex(PITCH)
ARRAYS = {
    "square": LensletArray(SQUARE, 3.5 * mm),
    "square, moved, gaps": LensletArray(
        Lattice.square(PITCH, origin=(13 * um, -21 * um)), 5 * mm, fill_factor=0.8
    ),
    "round": LensletArray(SQUARE, 3.5 * mm, shape="round", fill_factor=0.9),
    "hexagonal": LensletArray(HEX, 3.5 * mm),
    "three kinds": LensletArray(Lattice.hex(PITCH, kinds=3), (3 * mm, -4 * mm, 5 * mm), shape="round"),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_a_cell_has_the_fresnel_integral(name):
    array, size = ARRAYS[name], [PITCH, PITCH]
    if array.lattice.layout == "hex":
        size = [math.sqrt(3) / 2 * PITCH, PITCH]
    axes, center = (axis(size[0], 24), axis(size[1], 20)), (5 * um, -10 * um)
    assert_same(image_of(array, axes, center), propagated(array, axes, center))


@pytest.mark.parametrize("name", ["square", "round"])
def test_lenslets_beyond_the_limits_are_missing(name):
    """Three rows, the middle column: as an array of that extent, and unlike the whole one."""
    array, axes = ARRAYS[name], (axis(samples=16), axis(samples=18))
    limits = (-1.5 * PITCH, 1.5 * PITCH), (-0.5 * PITCH, 0.5 * PITCH)
    cut = image_of(array, axes, (0.0, 0.0), limits)
    assert_same(cut, propagated(replace(array, extent=(3 * PITCH, PITCH)), axes, (0.0, 0.0)))
    whole = image_of(array, axes, (0.0, 0.0))
    assert np.abs(cut - whole).max() > 0.03 * np.abs(whole).max()


@pytest.mark.parametrize("name", ["square", "round"])
def test_a_cell_far_outside_the_array_is_dark(name):
    axes = axis(samples=4), axis(samples=4)
    assert not image_of(ARRAYS[name], axes, (0.0, 0.0), ((10 * PITCH, 20 * PITCH), INFINITE)).any()
