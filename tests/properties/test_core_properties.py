"""Properties of the core nouns that hold for every one of them."""

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lumigraph import testing
from lumigraph.core.lattice import Lattice

quick = settings(deadline=None, max_examples=40)
places = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=20)


@quick
@given(st.booleans(), st.floats(-3.2, 3.2), places)
def test_no_place_is_farther_from_a_lattice_than_its_covering_radius(square, rotation, where):
    # p/√2 for a square lattice, p/√3 for a hexagonal one (Conway & Sloane, Sphere Packings, chapter 4).
    lattice = Lattice.square(1.0, rotation) if square else Lattice.hex(1.0, rotation)
    radius = 1 / math.sqrt(2) if square else 1 / math.sqrt(3)
    y, x = np.array(where).T
    assert np.hypot(*lattice.offset(y, x)).max() <= radius * (1 + 1e-12)


@quick
@given(testing.lattices(), places)
def test_offset_is_the_way_from_the_nearest_of_all_points(lattice, where):
    y, x = np.array(where).T * lattice.pitch
    dy, dx = lattice.offset(y, x)
    i, j = lattice.index(y, x)
    near = np.stack(
        [lattice.position(np.stack([i + a, j + b], -1)) for a in range(-2, 3) for b in range(-2, 3)]
    )
    best = np.hypot(near[..., 0] - y, near[..., 1] - x).min(axis=0)
    np.testing.assert_allclose(np.hypot(dy, dx), best, atol=1e-9 * lattice.pitch)


@quick
@given(testing.lattices(), st.integers(-50, 50), st.integers(-50, 50))
def test_index_is_the_inverse_of_position(lattice, i, j):
    y, x = lattice.position([i, j])
    assert tuple(map(int, lattice.index(y, x))) == (i, j)


@quick
@given(testing.lattices(), places, st.integers(-9, 9), st.integers(-9, 9))
def test_offset_repeats_with_every_lattice_vector(lattice, where, i, j):
    y, x = np.array(where).T * lattice.pitch
    shift = lattice.matrix @ [i, j]
    here, there = lattice.offset(y, x), lattice.offset(y + shift[0], x + shift[1])
    # Half-way between two points rounding may pick either: the distance is the same.
    np.testing.assert_allclose(np.hypot(*here), np.hypot(*there), atol=1e-9 * lattice.pitch)


@quick
@given(testing.lattices(strain=0.0))
def test_without_strain_both_pitches_agree_and_the_cell_has_the_layouts_area(lattice):
    factor = 1.0 if lattice.layout == "square" else math.sqrt(3) / 2
    np.testing.assert_allclose(lattice.pitches[0], lattice.pitches[1], rtol=1e-12)
    np.testing.assert_allclose(lattice.cell_area, factor * lattice.pitch**2, rtol=1e-9)


@quick
@given(testing.grids(), testing.grids())
def test_resized_grids_share_their_samples(grid, other):
    iy, ix = grid.samples_to(grid.resized(other.shape))
    resized = grid.resized(other.shape)
    np.testing.assert_allclose(grid.y[0] - resized.y[0], iy * grid.pitch[0], atol=1e-9 * grid.pitch[0])
    np.testing.assert_allclose(grid.x[0] - resized.x[0], ix * grid.pitch[1], atol=1e-9 * grid.pitch[1])


@quick
@given(testing.grids(min_side=2))
def test_frequencies_belong_to_the_window(grid):
    np.testing.assert_allclose(grid.fx[1] * grid.size[1] * np.sign(grid.fx[1]), 1.0, rtol=1e-12)
    np.testing.assert_allclose(grid.fy[1] * grid.size[0] * np.sign(grid.fy[1]), 1.0, rtol=1e-12)


@quick
@given(testing.fields(single=True), st.floats(0.1, 10))
def test_power_goes_with_the_square_of_the_amplitude(field, factor):
    assert field.data.dtype == np.complex64
    np.testing.assert_allclose((field * np.float32(factor)).power, field.power * factor**2, rtol=1e-4)


@quick
@given(testing.light_fields(), st.data())
def test_view_micro_image_and_epi_meet_in_one_number(views, data):
    v, u = (data.draw(st.integers(0, n - 1)) for n in views.aperture.shape)
    t, s = (data.draw(st.integers(0, n - 1)) for n in views.lenslets.shape)
    number = views.data[v, u, t, s]
    assert (views.view(v, u)[t, s] == number).all()
    assert (views.micro_image(t, s)[v, u] == number).all()
    assert (views.epi(v, t)[u, s] == number).all()


@quick
@given(testing.raw_images())
def test_drawn_raw_images_keep_to_their_bits(raw):
    assume(raw.bit_depth is not None)
    assert raw.data.max() < 2**raw.bit_depth
