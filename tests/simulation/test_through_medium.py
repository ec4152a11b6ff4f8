"""Microscopes' raw images of samples that refract."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.operators.microscope.medium import MediumImages
from lumigraph.units import um

LIGHT = lg.Incoherent(1e-2)


@pytest.fixture(scope="module")
def scope():
    return lg.LightFieldMicroscope(
        wavelength="525 nm",
        objective={"magnification": 20.0, "numerical_aperture": 0.15},
        lenslets={"pitch": "125 um", "focal_length": "5 mm", "count": (5, 5)},
        sensor={"pixel_pitch": "12.5 um"},
    )


def apart(found, expected):
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize("shape", [None, "round"])
def test_a_medium_that_does_nothing_changes_nothing(scope, shape):
    scope = scope.replace(lenslets={"shape": shape})
    grid = lg.Grid.square(8, 2 * um)
    medium = lg.Medium(np.zeros((2, 8, 8)), grid, (-20 * um, 60 * um))
    scene = lg.targets.points([(2 * um, -1 * um, 10 * um)])
    plain, seen = (lg.simulate(scope, scene, LIGHT, medium=one).data for one in (None, medium))
    assert apart(seen, plain) < 1e-2


def test_points_behind_a_lens_are_seen_farther_and_larger(scope):
    grid, place, away, focal = lg.Grid.square(61, 2 * um), np.array([3 * um, 0, 0]), 60 * um, 300 * um
    lens = lg.Medium(-(grid.y[:, None] ** 2 + grid.x**2)[None] / (2 * focal), grid, (-away,))
    seen_from = 1 / (1 / away - 1 / focal)
    image = [3 * um * seen_from / away, 0, seen_from - away]
    raw, plain, expected = (
        lg.simulate(scope, lg.targets.points([at]), LIGHT, medium=medium).data.astype(float)
        for at, medium in ((place, lens), (place, None), (image, None))
    )
    expected *= raw.sum() / expected.sum()
    assert apart(raw, expected) < 0.03
    assert apart(plain * raw.sum() / plain.sum(), expected) > 0.3


def test_coarse_slices_are_warned_of_and_finer_ones_are_not(scope):
    grid, z = lg.Grid.square(60, 1 * um), (np.arange(16) - 24) * 2.5 * um
    squared = grid.y[:, None] ** 2 + grid.x**2 + (z[:, None, None] + 30 * um) ** 2
    index = 0.02 / (1 + np.exp((np.sqrt(squared) - 15 * um) / (2 * um)))
    fine = lg.Medium.of_index(lg.Volume(index, grid, tuple(z)))
    scene = lg.targets.points([(0, 0, 5 * um)])
    expected = lg.simulate(scope, scene, LIGHT, medium=fine)
    with pytest.warns(lg.SamplingWarning, match="off by some"):
        found = lg.simulate(scope, scene, LIGHT, medium=fine.coarser().coarser().coarser())
    stated = found.metadata["error"]["rms"]
    assert expected.metadata["error"]["rms"] < 1e-2 < stated
    assert apart(found.data, expected.data) < 2 * stated


def test_twice_as_many_slices_hold_an_index_that_goes_over_evenly():
    """Paths of half the slabs, a quarter of the way to their neighbours'; given slices stay as they are."""
    grid, z = lg.Grid.square(4, 1 * um), np.arange(5) * 2 * um
    index = (0.01 + 0.003 * np.arange(5))[:, None, None] * np.ones((5, 4, 4))
    medium = lg.Medium.of_index(lg.Volume(index, grid, tuple(z)))
    finer = medium.finer()
    np.testing.assert_allclose(finer.depths, np.arange(8.5, -1, -1) * um, atol=1e-12)
    inner = slice(1, -1)
    expected = (0.01 + 0.0015 * np.array(finer.depths) / um) * 1 * um
    np.testing.assert_allclose(finer.paths[inner, 0, 0], expected[inner], rtol=1e-9)
    given = lg.Medium(medium.paths, grid, medium.depths)
    assert given.finer() is given


def test_planes_that_stand_too_far_apart_are_warned_of(scope, monkeypatch):
    grid = lg.Grid.square(8, 2 * um)
    medium = lg.Medium.of_index(lg.Volume(np.full((2, 8, 8), 1e-4), grid, (-20 * um, -10 * um)))
    monkeypatch.setattr(MediumImages, "between_planes", lambda self, place: 0.03)
    with pytest.warns(lg.SamplingWarning) as told:
        found = lg.simulate(scope, lg.targets.points([(0, 0, 1 * um)]), LIGHT, medium=medium)
    assert "planes stand 10 µm apart" in str(told[0].message)
    assert "changes by 0.03 rms; 0.01 was asked" in str(told[0].message)
    assert found.metadata["error"]["rms"] > 0.03


def test_minutes_are_said_before_they_are_spent(scope, monkeypatch):
    grid = lg.Grid.square(8, 2 * um)
    medium = lg.Medium(np.full((2, 8, 8), 10e-9), grid, (-20 * um, -10 * um))
    seen = MediumImages(scope.pupil_images((), farthest=20 * um, accuracy=1e-2), medium)
    one, four = (seen.seconds(np.full(n, 1 * um)) for n in (200, 800))
    assert four == pytest.approx(4 * one, rel=0.9)  # by the time of a transform
    assert seen.seconds(np.array([-30 * um])) == 0
    monkeypatch.setattr("lumigraph.simulation.through_medium.SAID", 0.0)
    with pytest.warns(lg.SamplingWarning, match=r"1 point through the medium: some .* min of this processor"):
        lg.simulate(scope, lg.targets.points([(0, 0, 1 * um)]), LIGHT, medium=medium)


def test_lit_samples_are_points(scope):
    grid = lg.Grid.square(8, 2 * um)
    medium = lg.Medium(np.full((1, 8, 8), 30e-9), grid, (-20 * um,))
    picture = np.zeros((3, 3))
    picture[1, 2] = 2.0
    own = lg.Grid.square(3, 1 * um)
    found = lg.simulate(scope, lg.Scene([lg.Slice(picture, own, 1 * um)]), LIGHT, medium=medium)
    share = 2 * (1 * um / scope.object_grid.pitch[0]) ** 2
    point = lg.targets.points([(0.0, 1 * um, 1 * um)], [share])
    np.testing.assert_allclose(found.data, lg.simulate(scope, point, LIGHT, medium=medium).data, atol=1e-7)


def test_what_no_medium_stands_before_is_refused(scope):
    medium = lg.Medium(np.zeros((1, 8, 8)), lg.Grid.square(8, 2 * um), (0.0,))
    with pytest.raises(lg.GeometryError, match="a white image has no medium"):
        lg.simulate(scope, lg.targets.white(), LIGHT, medium=medium)
    wide = lg.Scene([lg.Slice(np.ones((80, 80)), lg.Grid.square(80, 1 * um))])
    with pytest.raises(lg.SamplingError, match=r"has 6400 points and lit samples but a medium takes 5000"):
        lg.simulate(scope, wide, LIGHT, medium=medium)
    with pytest.raises(lg.GeometryError, match="medium is of light-field microscopes"):
        lg.simulate(
            lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1"),
            lg.targets.points([(0, 0)]),
            medium=medium,
        )
    point = lg.targets.points([(0, 0)])
    with pytest.raises(lg.GeometryError, match="medium and spectrum are both given"):
        lg.simulate(scope, point, spectrum=lg.Spectrum((5e-7,), ((1.0,),)), medium=medium)
