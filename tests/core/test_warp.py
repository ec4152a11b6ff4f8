"""Tilt and distortion of a lattice, and a calibration's places that honour them."""

import numpy as np
import pytest

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError

BENT = Warp((240.0, 320.0), (3e-5, -5e-5), 4e-8)


def calibration(warp=BENT, **changes):
    none = np.zeros((0, 2), int)
    return Calibration(Lattice.hex(17.3, 0.02, (200, 300)), (480, 640), none, none, 0.0, warp=warp, **changes)


@pytest.mark.parametrize("warp", [BENT, Warp((240, 320), (0, 1e-4), -3e-7), Warp((0, 0), radial=1e-7)])
def test_a_warp_is_removed_as_it_was_applied(warp, rng):
    points = rng.uniform(0, 640, (5, 40, 2))
    np.testing.assert_allclose(warp.removed(warp.applied(points)), points, atol=1e-7)
    np.testing.assert_allclose(warp.applied(np.array(warp.center)), warp.center)
    np.testing.assert_allclose(warp.removed(np.array(warp.center)), warp.center)


def test_positive_tilt_and_negative_radial_bring_the_far_micro_images_together():
    x = np.stack([np.zeros(5), np.arange(5) * 100.0], -1)
    tilted = Warp((0, 0), (0, 1e-4)).applied(x)[:, 1]
    barrel = Warp((0, 0), radial=-1e-7).applied(x)[:, 1]
    assert (np.diff(np.diff(tilted)) < 0).all()
    assert (np.diff(np.diff(barrel)) < 0).all()
    np.testing.assert_allclose(barrel, x[:, 1] * (1 - 1e-7 * x[:, 1] ** 2))


def test_every_place_belongs_to_the_nearest_warped_micro_image():
    found = calibration()
    indices = found.indices_within((0, 479), (0, 639))
    centers = found.position(indices)
    i, j = found.index(*centers.T)
    np.testing.assert_array_equal(np.stack([i, j], -1), indices)
    dy, dx = found.offset(centers[:, 0] + 1.5, centers[:, 1] - 2.0)
    np.testing.assert_allclose(np.stack([dy, dx], -1), np.tile([1.5, -2.0], (len(dy), 1)), atol=1e-7)
    # All that stand on the picture, none twice.
    plenty = found.position(found.lattice.indices((-200, 700), (-200, 900)))
    on = ((plenty >= 0) & (plenty <= (479, 639))).all(-1)
    np.testing.assert_allclose(np.sort(centers, axis=0), np.sort(plenty[on], axis=0))
    np.testing.assert_array_equal(found.centers_within((0, 479), (0, 639)), centers)


def test_without_a_warp_the_places_are_the_lattice_points():
    found = calibration(None)
    np.testing.assert_array_equal(found.position(np.array([[2, 3]])), found.lattice.position([[2, 3]]))
    assert [int(v) for v in found.index(100.0, 90.0)] == [int(v) for v in found.lattice.index(100.0, 90.0)]


def test_exchanged_axes_exchange_places_and_kinds():
    lattice = Lattice.hex(17.3, 0.02, (200, 300), kinds=3)
    indices = lattice.indices((50, 400), (60, 500))
    found = Calibration(
        lattice, (480, 640), indices, BENT.applied(lattice.position(indices)), 0.0,
        warp=BENT, sharpness=(1.2, 1.0, 0.8),
    )  # fmt: skip
    flipped = found.transposed()
    np.testing.assert_allclose(flipped.position(flipped.indices), found.centers[:, ::-1])
    np.testing.assert_allclose(flipped.residuals, 0, atol=1e-9)
    kinds = [(c, c.lattice.kind(*c.indices.T)) for c in (found, flipped)]
    same = [np.array(c.sharpness)[kind] for c, kind in kinds]
    np.testing.assert_array_equal(*same)


def test_bad_values_are_refused():
    with pytest.raises(CalibrationError, match=r"warp\.tilt"):
        Warp((0, 0), (float("nan"), 0))
    with pytest.raises(CalibrationError, match=r"light has shape \(3,\) but there are 0 centers"):
        calibration(light=np.ones(3))
    with pytest.raises(CalibrationError, match=r"missing has shape \(3,\) but must be \(m, 2\)"):
        calibration(missing=np.ones(3))
    with pytest.raises(CalibrationError, match="fill is -1"):
        calibration(fill=-1.0)


def test_the_farthest_move_of_a_picture():
    assert Warp((0, 0), radial=1e-6).largest((101, 101)) == pytest.approx(1e-6 * (100 * 2**0.5) ** 3)
