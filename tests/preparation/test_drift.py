"""Raw images of a lattice that is known, beside calibrations that are off by known amounts."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.drift import is_bad, judged
from scipy import ndimage

import calibration_drawing
from data_folder import real
from lumigraph import io
from lumigraph.calibration import calibrate
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError, SamplingWarning
from lumigraph.preparation import decode, prepare
from lumigraph.preparation.drift import _middle, check_drift, drift

NONE = np.zeros((0, 2))


def raw_image(lattice, shape, rng, fill=0.85, noise=0.02, warp=None):
    """A scene of spots and stripes behind round micro-images, each of which shows it turned round."""
    white = calibration_drawing.white(lattice, shape, fill=fill, warp=warp)[0]
    paint = ndimage.gaussian_filter(rng.standard_normal(shape), 1.7 * lattice.pitch)
    paint = 0.25 + (paint - paint.min()) / np.ptp(paint)
    dy, dx = lattice.offset(np.arange(shape[0])[:, None], np.arange(shape[1]))
    y, x = np.arange(shape[0])[:, None] - 3 * dy, np.arange(shape[1]) - 3 * dx
    scene = ndimage.map_coordinates(paint, [y, x], order=1, mode="reflect")
    return white * scene + noise * rng.standard_normal(shape) + 0.02


def off(lattice, stretch=1.0, turn=0.0, move=(0.0, 0.0), shape=(400, 440)):
    """A calibration whose lattice is another one about the middle of the picture."""
    cos, sin = stretch * math.cos(turn), stretch * math.sin(turn)
    matrix = np.array([[cos, sin], [-sin, cos]])  # on (y, x)
    middle = np.array(shape) / 2
    origin = middle + matrix @ (np.array(lattice.origin) - middle) + move
    basis = tuple(tuple(matrix @ np.array(vector)) for vector in lattice.basis)
    return Calibration(replace(lattice, basis=basis, origin=tuple(origin)), shape, NONE, NONE, 0.0)


LATTICES = {
    "square": Lattice.square(14.3, 0.01, (200, 210)),
    "hex": Lattice.hex(17.7, -0.02, (200, 210)),
    "columns": Lattice.hex(13.6, math.pi / 6 + 0.01, (200, 210)),
}


@pytest.mark.parametrize("name", LATTICES)
@pytest.mark.parametrize(("stretch", "turn"), [(1, 0), (1.004, 0), (0.97, 0.01), (1.12, -0.03), (0.83, 0.06)])
def test_the_lattice_of_a_raw_image_is_measured_beside_another(name, stretch, turn, rng):
    lattice = LATTICES[name]
    found = drift(raw_image(lattice, (400, 440), rng), off(lattice, stretch, turn))
    assert found is not None
    # 0.0005 of 14 px over 30 lenslets is a hundredth of a pitch at the border.
    assert found.pitch == pytest.approx(lattice.pitch, rel=5e-4)
    assert found.rotation == pytest.approx(lattice.rotation, abs=5e-4)
    assert found.expected_pitch == pytest.approx(lattice.pitch * stretch)
    corner = np.hypot(200, 220) / lattice.pitch * math.hypot(1 / stretch - math.cos(turn), math.sin(turn))
    assert found.slip == pytest.approx(corner, rel=0.3, abs=0.02)


@pytest.mark.parametrize("name", LATTICES)
def test_a_drift_is_refused_or_warned_of_with_both_numbers(name, rng):
    lattice = LATTICES[name]
    raw, p = raw_image(lattice, (400, 440), rng), lattice.pitch
    with pytest.raises(CalibrationError, match=rf"repeats every {p:.2f}\d* px.*pitch of {p * 1.05:.3f}"):
        decode(raw, off(lattice, 1.05))
    with pytest.raises(CalibrationError, match=r"turned by .* but .* turned by .* slip by [1-9]"):
        decode(raw, off(lattice, 1, 0.07))
    with pytest.warns(SamplingWarning, match=r"they slip by 0\.[1-4]"):
        decode(raw, off(lattice, 1.01))
    decode(raw, off(lattice))  # warnings are errors


def test_a_shift_is_told_in_pixels(rng):
    lattice = LATTICES["square"]
    with pytest.warns(SamplingWarning, match=r"stand \(\+5\.\d, -0\.\d\) px|stand \(\+5\.\d, \+0\.\d\) px"):
        decode(raw_image(lattice, (400, 440), rng), off(lattice, move=(-5.0, 0.0)))


def test_a_tilted_and_distorted_lattice_is_no_drift(rng):
    lattice, warp = LATTICES["square"], Warp((199.5, 219.5), (2e-4, -1e-4), 2e-7)
    raw = raw_image(lattice, (400, 440), rng, warp=warp)
    found = drift(raw, replace(off(lattice), warp=warp))
    assert found is not None
    assert found.slip < 0.05  # 0.03 of which is the window's weight on what the tilt moves


def test_pictures_without_a_lattice_of_their_own_tell_nothing(rng):
    calibration = off(LATTICES["square"])
    for picture in (
        np.ones((400, 440)), rng.standard_normal((400, 440)), np.eye(400, 440), np.zeros((400, 440)),
        ndimage.gaussian_filter(rng.standard_normal((400, 440)), 4),
    ):  # fmt: skip
        assert drift(picture, calibration) is None
    few = Lattice.square(70.0, 0, (200, 210))
    assert drift(raw_image(few, (400, 440), rng), off(few, 1.1)) is None


def test_stripes_and_spots_of_the_scene_are_no_lattice(rng):
    """A scene that repeats along one direction, and a point whose spots repeat as its depth says."""
    lattice = LATTICES["square"]
    y, x = np.mgrid[:400, :440]
    stripes = 1.1 + np.sin(2 * np.pi * x / 15.1)
    assert drift(stripes * raw_image(lattice, (400, 440), rng), off(lattice)).slip < 0.1
    assert drift(stripes, off(lattice)) is None
    point = (np.hypot(*Lattice.square(15.1, 0, (200, 210)).offset(y, x)) < 3) * np.exp(
        -np.hypot(y - 200, x - 220) / 25
    )
    assert drift(point, off(lattice)) is None


def test_a_point_far_out_of_focus_is_no_lattice():
    """Its spots stand on every lenslet of a disc, as far apart as its depth says, and as sharp as gaps."""
    lattice = LATTICES["square"]
    y, x = np.mgrid[:400, :440]
    spots = np.exp(-((np.hypot(*Lattice.square(13.4, 0.0, (200, 210)).offset(y, x)) / 4) ** 2))
    picture = spots * np.exp(-((np.hypot(y - 200, x - 210) / 130) ** 6))
    assert drift(picture, off(lattice)) is None
    decode(picture, off(lattice))  # neither refused nor warned of


def test_a_prepared_picture_is_not_looked_at_again(rng):
    lattice = LATTICES["square"]
    raw, calibration = raw_image(lattice, (400, 440), rng), off(lattice, 1.01)
    with pytest.warns(SamplingWarning):
        ready = prepare(raw, calibration)
    decode(ready, calibration)  # warnings are errors
    assert any("slips by 0." in note for note in ready.notes)


def test_of_a_large_colour_picture_the_middle_is_looked_at():
    picture, corner = _middle(np.ones((1500, 1601, 3), np.float32))
    assert (picture.shape, corner.tolist()) == ((1024, 1024), [238, 288])


def test_the_lattice_seen_is_the_expected_one_turned_and_stretched(rng):
    lattice = LATTICES["hex"]
    expected = off(lattice, 1.03, 0.02)
    seen = drift(raw_image(lattice, (400, 440), rng), expected).seen(expected.lattice)
    np.testing.assert_allclose(seen.matrix, lattice.matrix, atol=0.02)
    assert (seen.layout, seen.origin) == ("hex", expected.lattice.origin)


REAL = {
    "letters": ("letters_plenoptic1", "letters_ULF_M1_white.png", "letters_ULF_M1.png"),
    "vesicle": ("lfm_guv", "Radiometry_GUVExperim1.tif", "Lightfield_GUVExperim1.tif"),
    "simulated": ("lfm_guv_simulated", "Radiometry_GUVSimul1.tif", "LightField_GUVSimul1.tif"),
    "worm": (
        "lfm_worm",
        *["20131219WORM2_small_full_neg_X1_N15_cropped_uncompressed.tif"] * 2,
    ),
}


@pytest.mark.parametrize("name", REAL)
def test_real_cameras_fit_their_calibration_and_drift_is_seen(name):
    folder, white, raw = REAL[name]
    found, picture = calibrate(io.open(real(folder, white))), io.open(real(folder, raw)).data
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_drift(picture, found)
    for stretch, turn in ((1.02, 0), (1, math.radians(2))):
        moved = replace(off(found.lattice, stretch, turn, shape=found.shape))
        seen = drift(picture, moved)
        assert seen is not None
        assert seen.pitch == pytest.approx(found.lattice.pitch, rel=2e-3)
        assert seen.expected_pitch == pytest.approx(found.lattice.pitch * stretch, rel=1e-6)
        assert seen.slip > 0.2


def test_lines_that_a_specimen_pulls_at_contradict_no_calibration():
    """Rectified to 17 px: its lines scatter by a fifth of a pitch, and made a lattice of 16.95 px."""
    raw = np.asarray(io.open(real("lfm_worm", REAL["worm"][1])).data, np.float32)
    picture = ndimage.zoom(raw, 17 / 15, order=1, grid_mode=True, mode="nearest")
    found = drift(picture, off(Lattice.square(17.0, 0, (8.5, 8.5)), shape=picture.shape))
    assert found.slip > 0.1, "which was warned of"
    assert found.error > found.slip / 3
    check_drift(picture, off(Lattice.square(17.0, 0, (8.5, 8.5)), shape=picture.shape))  # warns of nothing


def test_a_slip_is_told_with_its_error(rng):
    lattice = LATTICES["square"]
    raw = raw_image(lattice, (400, 440), rng)
    slips = [drift(raw + 0.1 * rng.standard_normal(raw.shape), off(lattice)) for _ in range(4)]
    assert all(0 < found.slip < 4 * found.error < 0.1 for found in slips)
    assert all(found.told().endswith("towards the border") for found in slips)


def test_a_part_of_the_picture_that_is_out_of_step_makes_no_slip(rng):
    """Behind an edge, where light only strays, spots stand half a pitch from those in the light."""
    lattice = LATTICES["square"]
    both = [raw_image(one, (400, 440), rng) for one in (lattice, lattice.moved(0.0, lattice.pitch / 2))]
    half = np.where(np.arange(440) < 180, both[1], both[0])
    found = drift(half, off(lattice))
    assert found.slip > 0.1, "which was warned of"
    assert found.slip < 3 * found.error
    assert f"known only to ±{3 * found.error:.2f}" in found.told()
    decode(half, off(lattice))  # warnings are errors


@pytest.mark.parametrize("number", [77, 135, 142])  # 2.0, hexagonal out of focus, few lenslets drawn
def test_an_edge_is_no_lattice(number):
    """In and out of focus: of 160 edges 13 were warned of; each of these was."""
    assert not [row for row in judged("edges", number) if row.pair == "right" and is_bad(row)]


@pytest.mark.parametrize("number", [0, 3, 4, 13])  # points, a grating, a chart, a texture
def test_drawn_pairs_are_right_or_wrong_as_they_were_drawn(number):
    """A few of the pairs of `python -m benchmarks.drift`."""
    rows = judged("drawn", number)
    assert not [row for row in rows if is_bad(row)]
    assert [row.said for row in rows] == (["nothing"] * 3 if number == 0 else ["fits", "warned", "warned"])


# Points, a grating, a chart that repeats more strongly than the lattice, a texture behind hardly any gaps.
@pytest.mark.parametrize("number", [0, 3, 68, 69])
def test_simulated_pairs_are_right_or_wrong_as_they_were_made(number):
    assert not [row for row in judged("simulated", number) if is_bad(row)]
