"""Fused maps, distances in metres, points in space."""

import numpy as np
import pytest

from lumigraph.core.arrays import namespace, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.depth import BiasCurve, DepthMap, alpha_of, cloud, fuse, metric, virtual_depth
from lumigraph.design import plenoptic1
from lumigraph.errors import CalibrationError, GeometryError
from lumigraph.instruments import FocusedPlenopticCamera

Y, X = np.meshgrid(np.arange(48.0), np.arange(56.0), indexing="ij")
SLANT = 0.02 * X - 0.01 * Y
STEP = np.where(X < 28, 0.0, 1.0)


def estimate(truth, rng, deviation=0.05, lost=0.0):
    """A noisy map; part of it is lost: values far off, with a low confidence."""
    values = truth + deviation * rng.standard_normal(truth.shape)
    bad = rng.random(truth.shape) < lost
    values = np.where(bad, rng.uniform(-3, 3, truth.shape), values)
    return DepthMap(values, np.where(bad, 0.05, 0.8), "disparity")


@pytest.mark.parametrize("truth", [SLANT, STEP], ids=["slant", "step"])
def test_fused_maps_are_better_than_each(truth, rng):
    maps = [estimate(truth, rng, lost=0.2), estimate(truth, rng, lost=0.2)]
    found = fuse(maps, picture=STEP)
    errors = [np.abs(one.values - truth).mean() for one in (*maps, found)]
    assert errors[2] < 0.035 < 0.15 < min(errors[:2])
    # Tears stay where they are: first differences are not held small.
    # One place in 25 is lost in both maps: beside the edge, where the surface is free, a few of them stay so.
    assert (np.abs(found.values - truth)[:, 20:36] > 0.4).mean() < 0.01


def test_confidence_is_high_where_sure_maps_agree():
    one = DepthMap(SLANT, np.full(SLANT.shape, 0.8), "disparity")
    other = DepthMap(np.where(X < 28, SLANT, SLANT + 5), np.full(SLANT.shape, 0.3), "disparity")
    trust = np.asarray(fuse([one, other]).confidence)
    assert trust[:, :20].min() > trust[:, 36:].max()


def test_unknown_places_are_filled_in(xp):
    values = np.where((X > 20) & (X < 30), np.nan, SLANT)
    known = DepthMap(xp.asarray(values), xp.asarray(np.full(values.shape, 0.9)), "alpha")
    found = fuse(known)
    assert namespace(found.values) is namespace(known.values)
    np.testing.assert_allclose(to_numpy(found.values), SLANT, atol=0.03)
    assert to_numpy(found.confidence)[:, 24:27].max() == 0


def test_maps_that_do_not_belong_together_are_refused():
    one = DepthMap(SLANT, np.ones(SLANT.shape), "disparity")
    with pytest.raises(GeometryError, match="no map to fuse"):
        fuse([])
    with pytest.raises(GeometryError, match=r"disparity of shape \(48, 56\) and alpha of shape"):
        fuse([one, DepthMap(SLANT, np.ones(SLANT.shape), "alpha")])
    with pytest.raises(GeometryError, match="smoothness is -1"):
        fuse(one, smoothness=-1)
    with pytest.raises(GeometryError, match="no map has a finite value"):
        fuse(DepthMap(SLANT * np.nan, np.ones(SLANT.shape), "alpha"))
    with pytest.raises(GeometryError, match=r"picture has shape \(3, 3\)"):
        fuse(one, np.ones((3, 3)))
    with pytest.raises(GeometryError, match="picture has 1 NaN"):
        fuse(one, np.where((X == 1) & (Y == 1), np.nan, 1.0))


def test_a_depth_map_holds_one_known_quantity():
    with pytest.raises(GeometryError, match="quantity is 'distance' but must be one of"):
        DepthMap(SLANT, SLANT, "distance")
    with pytest.raises(GeometryError, match=r"values have shape \(48, 56\) and confidence \(3,\)"):
        DepthMap(SLANT, np.ones(3), "depth")
    with pytest.raises(GeometryError, match=r"holds depth \[m\] but alpha is needed"):
        _ = DepthMap(SLANT, SLANT, "depth").alpha
    with pytest.raises(GeometryError, match="values is of type list"):
        DepthMap([[1.0]], SLANT, "depth")


@pytest.fixture
def views():
    data = np.zeros((3, 3, 2, 3))
    return LightField(data, Grid((3, 3), 1e-3), Grid((2, 3), 1e-4), 0.24)


@pytest.mark.parametrize("dz", [-0.05, 0.0, 0.05])
def test_refocus_factors_become_the_distances_they_were_made_of(views, dz):
    alpha = plenoptic1.refocus_factor(0.12, 0.24, dz)
    disparity = DepthMap(np.full((2, 3), (1 - alpha) * 10), np.ones((2, 3)), "disparity")
    assert alpha_of(disparity, views).values[0, 0] == pytest.approx(alpha)
    depth = metric(disparity, views, focal_length=0.12)
    assert (depth.quantity, depth.unit) == ("depth", "m")
    np.testing.assert_allclose(depth.values, dz, atol=1e-12)


def test_places_beyond_infinity_are_unknown(views):
    alpha = DepthMap(np.array([[1.0, 2.1, -1.0]] * 2), np.ones((2, 3)), "alpha")
    depth = metric(alpha, views, focal_length=0.12)
    assert np.isnan(depth.values).tolist() == [[False, True, True]] * 2
    assert np.asarray(depth.confidence).tolist() == [[1, 0, 0]] * 2


def test_diffraction_is_corrected_before_the_lens_equation(views):
    curve = BiasCurve([0.8, 1.0, 1.2], [0.6, 1.0, 1.4])
    alpha = DepthMap(np.full((2, 3), 0.9), np.ones((2, 3)), "alpha")
    depth = metric(alpha, views, focal_length=0.12, correction=curve)
    expected = plenoptic1.defocus(0.12, 0.24, float(curve(0.9)))
    np.testing.assert_allclose(depth.values, expected, rtol=1e-9)
    assert expected < plenoptic1.defocus(0.12, 0.24, 0.9)


@pytest.mark.parametrize(("magnification", "kind"), [(0.3, "Keplerian"), (-0.25, "Galilean")])
@pytest.mark.parametrize("dz", [-2e-3, 5e-3])
def test_patches_become_the_distances_they_were_made_of(magnification, kind, dz):
    camera = FocusedPlenopticCamera(
        wavelength="633 nm", object_distance="120 mm", main_lens={"focal_length": "60 mm"},
        lenslets={"pitch": "150 um", "focal_length": "5 mm", "count": (7, 7), "magnification": magnification},
        sensor={"pixel_pitch": "6 um"},
    )  # fmt: skip
    shape = (2, 2)
    patch = DepthMap(np.full(shape, camera.patch_at(dz)), np.ones(shape), "patch")
    depth = metric(patch, camera.calibration, focal_length=0.06, object_distance=0.12)
    np.testing.assert_allclose(depth.values, dz, rtol=1e-6)
    relay = camera.lenslet_distance / camera.magnification_at(dz)
    virtual = virtual_depth(patch, camera.calibration)
    np.testing.assert_allclose(virtual.values, abs(relay) / camera.lenslet_distance, rtol=1e-9)


def test_points_lie_on_rays_through_the_middle_of_the_lens(views):
    depth = DepthMap(np.array([[0.0, 0.1, np.nan]] * 2), np.array([[1.0, 1.0, 0.0]] * 2), "depth")
    found = cloud(depth, views, object_distance=0.24, colours=np.ones((2, 3)))
    assert len(found) == 4
    z, y, x = found.points[0]
    # Lenslet (0, 0) stands one pitch up and one to the left, 0.24 m behind the lens; magnification 1.
    np.testing.assert_allclose([z, y, x], [0.24, -1e-4, -1e-4], rtol=1e-6)
    np.testing.assert_allclose(found.points[1], [0.34, -1e-4 * 0.34 / 0.24, 0.0], rtol=1e-6, atol=1e-12)
    assert found.colours.shape == (4, 3)


def test_what_has_no_distance_is_refused(views):
    patch = DepthMap(np.ones((2, 3)), np.ones((2, 3)), "patch")
    none = np.zeros((0, 2))
    calibration = Calibration(Lattice.square(10.0, origin=(5, 5)), (20, 30), none, none, 0.0)
    with pytest.raises(GeometryError, match="Give object_distance="):
        metric(patch, calibration_with_lengths(calibration), focal_length=0.1)
    with pytest.raises(CalibrationError, match="calibration has no pixel_pitch"):
        metric(patch, calibration, focal_length=0.1, object_distance=0.3)
    with pytest.raises(CalibrationError, match="source is of type LightField but must be a Calibration"):
        metric(patch, views, focal_length=0.1, object_distance=0.3)
    with pytest.raises(GeometryError, match="must be a LightField"):
        metric(DepthMap(patch.values, patch.values, "alpha"), calibration, focal_length=0.1)
    with pytest.raises(GeometryError, match="focal_length is 0 m"):
        metric(patch, calibration, focal_length=0)
    depth = DepthMap(np.ones((2, 3)), np.ones((2, 3)), "depth")
    with pytest.raises(GeometryError, match="holds patch"):
        cloud(patch, views, object_distance=0.3)
    with pytest.raises(GeometryError, match=r"colours have shape \(3, 3\)"):
        cloud(depth, views, object_distance=0.3, colours=np.ones((3, 3)))
    with pytest.raises(GeometryError, match=r"map has shape \(1, 1\) but its source has \(2, 3\)"):
        cloud(DepthMap(np.ones((1, 1)), np.ones((1, 1)), "depth"), views, object_distance=0.3)
    np.testing.assert_allclose(virtual_depth(patch, calibration).values, 10.0)


def calibration_with_lengths(calibration):
    from dataclasses import replace

    return replace(calibration, pixel_pitch=1e-5, separation=0.2, lenslet_distance=5e-3)


def test_expected_errors_go_with_their_values_into_other_quantities():
    views = LightField(np.zeros((3, 3, 1, 2)), Grid((3, 3), 2.0), Grid((1, 2), 0.1), 20.0)
    found = DepthMap(np.array([[0.5, 0.0]]), np.ones((1, 2)), "disparity", np.array([[0.04, np.nan]]))
    # Δs/Δu = 1/20.
    np.testing.assert_allclose(alpha_of(found, views).error, [[0.002, np.nan]])
    near = DepthMap(found.values + 1e-4, found.confidence, "disparity")
    first, second = (metric(one, views, focal_length=8.0) for one in (found, near))
    slope = abs(np.asarray(second.values) - np.asarray(first.values))[0, 0] / 1e-4
    assert first.error[0, 0] == pytest.approx(0.04 * slope, rel=1e-3)
    assert found.usual_error == 0.04
    assert DepthMap(found.values, found.confidence, "alpha").usual_error is None
    with pytest.raises(GeometryError, match=r"values have shape \(1, 2\) and error \(2,\) but both"):
        DepthMap(found.values, found.confidence, "disparity", np.zeros(2))


def test_diffractions_pull_is_part_of_the_expected_error():
    """Of a camera 1.0 with p²/(λb) = 11: planes at 15 to 80 mm were off by 3 to 14 times what was said."""
    views = LightField(np.zeros((9, 9, 1, 3)), Grid((9, 9), 5.7e-3 / 9), Grid((1, 3), 60e-6), 57.143e-3)
    seen = np.array([[-0.0268, -0.1025, -0.2179]])  # by `epi`, of textured planes by wave optics
    found = DepthMap(seen, np.ones((1, 3)), "disparity", np.array([[0.0075, 0.0072, 0.003]]))
    depth = metric(found, views, focal_length=0.05, object_distance=0.4)
    off = np.abs(depth.values - [[15e-3, 40e-3, 80e-3]])
    assert (off < 2 * depth.error).all()
    assert (off > 0.5 * depth.error).all()
    blue = metric(found, views, focal_length=0.05, object_distance=0.4, wavelength=275e-9)
    assert (blue.error < 0.6 * depth.error).all()
    fixed = metric(found, views, focal_length=0.05, object_distance=0.4, correction=lambda alpha: alpha)
    assert fixed.error is None
