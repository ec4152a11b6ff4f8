"""Depth from focus: known planes, simulated points, and what is refused."""

import numpy as np
import pytest

from data_folder import real
from lumigraph import io
from lumigraph.core.arrays import namespace, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.depth import BiasCurve, DepthMap, from_focus
from lumigraph.depth.from_focus import point_alpha, sharpness
from lumigraph.depth.quantities import disparity_per_alpha
from lumigraph.errors import CalibrationError, GeometryError

ALPHAS = np.linspace(0.8, 1.2, 21)
APERTURE, LENSLETS = Grid((5, 5), (0.4, 0.4)), Grid((32, 48), (0.1, 0.1))


def plane(texture, alpha):
    """Light field of a textured plane in closed form: L(x, u) = texture(x'), α'x' = x - u (1 - α')."""
    v, u, y, x = np.meshgrid(APERTURE.y, APERTURE.x, LENSLETS.y, LENSLETS.x, indexing="ij")
    return texture((y - v * (1 - alpha)) / alpha, (x - u * (1 - alpha)) / alpha)


def waves(y, x):
    return 1 + 0.4 * np.sin(9 * x + 4 * y) + 0.4 * np.cos(8 * y - 5 * x)


def two_planes():
    """Left half at α' = 0.9, right half at 1.1."""
    near, far = plane(waves, 0.9), plane(waves, 1.1)
    return np.where(np.arange(LENSLETS.shape[1]) < LENSLETS.shape[1] // 2, near, far)


def test_two_textured_planes_are_told_apart(xp):
    data = xp.asarray(two_planes())
    found = from_focus(LightField(data, APERTURE, LENSLETS, 20.0), ALPHAS)
    assert isinstance(found, DepthMap)
    assert (found.quantity, found.unit) == ("alpha", "1")
    assert namespace(found.alpha) is namespace(data)
    alpha, trust = to_numpy(found.alpha), to_numpy(found.confidence)
    # The texture is slow against the lenslets, so that interpolation does not bias the peak.
    assert np.abs(alpha[6:-6, 6:18] - 0.9).max() < 0.01
    assert np.abs(alpha[6:-6, 30:-6] - 1.1).max() < 0.01
    assert trust[6:-6, 6:18].min() > 0.1


def test_single_precision_stays_single():
    views = LightField(two_planes().astype(np.float32), APERTURE, LENSLETS, 20.0)
    found = from_focus(views, ALPHAS)
    assert found.alpha.dtype == found.confidence.dtype == np.float32


def test_even_surfaces_have_no_confidence():
    views = LightField(np.ones((5, 5, 32, 48)), APERTURE, LENSLETS, 20.0)
    assert to_numpy(from_focus(views, ALPHAS).confidence).max() < 1e-3


def test_depths_outside_the_stack_have_no_confidence():
    views = LightField(plane(waves, 0.7), APERTURE, LENSLETS, 20.0)
    trust = from_focus(views, ALPHAS).confidence[6:-6, 6:-6]
    assert (trust == 0).mean() > 0.5


def test_colours_are_averaged():
    grey = two_planes()
    colour = np.stack([np.full_like(grey, grey.mean()), 2 * grey, 3 * grey - grey.mean()], -1) / 2
    one = from_focus(LightField(grey, APERTURE, LENSLETS, 20.0), ALPHAS)
    three = from_focus(LightField(colour, APERTURE, LENSLETS, 20.0), ALPHAS)
    np.testing.assert_allclose(three.alpha, one.alpha, atol=1e-9)


@pytest.mark.parametrize("alpha", [0.87, 1.0, 1.12])
def test_a_point_seen_by_ray_optics_is_where_it_is_sharpest(alpha):
    def spot(y, x):
        return np.exp(-(y**2 + x**2) / 0.08)

    views = LightField(plane(spot, alpha), APERTURE, LENSLETS, 20.0)
    # Without diffraction there is no bias: only the step of the stack is left.
    assert point_alpha(views, ALPHAS) == pytest.approx(alpha, abs=0.004)


def test_confidence_does_not_depend_on_brightness():
    bright, dim = (LightField(k * two_planes(), APERTURE, LENSLETS, 20.0) for k in (1.0, 1e-3))
    np.testing.assert_allclose(from_focus(dim, ALPHAS).confidence, from_focus(bright, ALPHAS).confidence)


def test_a_correction_is_applied_to_what_was_measured():
    views = LightField(plane(waves, 0.9), APERTURE, LENSLETS, 20.0)
    curve = BiasCurve([0.7, 1.0, 1.3], [0.4, 1.0, 1.6])
    plain, corrected = from_focus(views, ALPHAS), from_focus(views, ALPHAS, correction=curve)
    middle = (slice(6, -6), slice(6, -6))
    np.testing.assert_allclose(corrected.alpha[middle], 2 * plain.alpha[middle] - 1, atol=1e-9)
    measured = point_alpha(views, ALPHAS)
    assert point_alpha(views, ALPHAS, correction=curve) == pytest.approx(2 * measured - 1)


def test_sharpness_does_not_depend_on_brightness_but_on_area():
    stack = np.zeros((3, 8, 8))
    stack[0, 2:4, 2:4] = 1.0
    stack[1, 2:6, 2:6] = 7.0
    np.testing.assert_allclose(sharpness(stack), [1 / 4, 1 / 16, 0])


def test_a_bias_curve_is_measured_from_light_fields_of_known_points():
    curve = BiasCurve.simulated(
        lambda alpha: LightField(np.full((1, 1, 1, 1), alpha), Grid.square(1, 1), Grid.square(1, 1), 1.0),
        [0.5, 1.0, 1.5],
        lambda views: 0.5 + 0.5 * float(views.data[0, 0, 0, 0]),
    )
    np.testing.assert_allclose(curve([0.75, 1.0, 1.1]), [0.5, 1.0, 1.2], atol=0.02)
    assert np.isnan(curve(0.6))


def test_curves_and_stacks_that_cannot_be_used_are_refused():
    views = LightField(np.ones((5, 5, 32, 48)), APERTURE, LENSLETS, 20.0)
    with pytest.raises(GeometryError, match=r"needs \(n,\), three at least"):
        from_focus(views, [0.9, 1.0])
    with pytest.raises(GeometryError, match="ascend in equal steps"):
        point_alpha(views, [0.9, 1.0, 1.2])
    with pytest.raises(GeometryError, match="window"):
        from_focus(views, ALPHAS, window=0)
    with pytest.raises(GeometryError, match=r"must be \(n, t, s\), grey"):
        sharpness(np.ones((2, 3, 3, 3)))
    with pytest.raises(CalibrationError, match="two at least"):
        BiasCurve([1.0], [1.0])
    with pytest.raises(CalibrationError, match="measured refocus factors must ascend but 1 is followed by 1"):
        BiasCurve([0.9, 1.0, 1.0], [0.8, 1.0, 1.1])


def test_a_real_set_of_pictures_has_its_depths():
    """The thesis' 4.7 on 5 x 5 pictures with known disparities; those of the other sign are 1.7 px off."""
    folder, part = real("hci_antinous"), np.s_[180:308, 180:308]
    views, truth = io.open(folder), io.open(folder / "gt_disp_lowres.pfm").data[part]
    data = np.asarray(views.data)[::2, ::2][:, :, part[0], part[1]].mean(-1)
    few = LightField(
        data,
        Grid((5, 5), 2 * views.aperture.pitch[0]),
        Grid((128, 128), views.lenslets.pitch[0]),
        views.separation,
    )
    per = disparity_per_alpha(few)[1]
    found = from_focus(few, np.sort(1 - np.linspace(-6, 6, 49) / per))
    error = np.abs((1 - found.alpha) * per / 2 - truth)[8:-8, 8:-8]
    trust = found.confidence[8:-8, 8:-8]
    assert np.median(error) < 0.08
    assert np.median(error[trust > np.median(trust)]) < 0.03
