import math

import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import ZernikePlate, noll_to_nm, zernike
from lumigraph.errors import GeometryError


def test_nolls_order_is_his_table():
    # Noll 1976, table I.
    orders = "0 1 1 2 2 2 3 3 3 3 4 4 4 4 4 5 5 5 5 5 5 6"
    azimuths = "0 1 -1 0 -2 2 -1 1 -3 3 0 2 -2 4 -4 1 -1 3 -3 5 -5 0"
    table = list(zip(map(int, orders.split()), map(int, azimuths.split()), strict=True))
    assert [noll_to_nm(j) for j in range(1, 23)] == table


def test_polynomials_are_orthonormal_over_the_disc():
    # Gauss-Legendre in ρ and an even step in θ integrate these polynomials exactly.
    nodes, weights = np.polynomial.legendre.leggauss(12)
    rho, theta = np.meshgrid((nodes + 1) / 2, np.arange(32) * 2 * math.pi / 32, indexing="ij")
    measure = (weights[:, None] / 2) * rho * 2 / 32
    values = np.array([zernike(j, rho, theta) for j in range(1, 37)])
    np.testing.assert_allclose(np.einsum("iab,jab,ab->ij", values, values, measure), np.eye(36), atol=1e-12)


def test_the_first_polynomials_are_their_closed_forms(rng):
    y, x = rng.uniform(-0.7, 0.7, (2, 30))
    r2 = x**2 + y**2
    forms = {
        1: np.ones(30), 2: 2 * x, 3: 2 * y, 4: math.sqrt(3) * (2 * r2 - 1),
        5: math.sqrt(6) * 2 * x * y, 6: math.sqrt(6) * (x**2 - y**2),
        7: math.sqrt(8) * (3 * r2 - 2) * y, 8: math.sqrt(8) * (3 * r2 - 2) * x,
        9: math.sqrt(8) * (3 * x**2 * y - y**3), 10: math.sqrt(8) * (x**3 - 3 * x * y**2),
        11: math.sqrt(5) * (6 * r2**2 - 6 * r2 + 1),
    }  # fmt: skip
    for j, expected in forms.items():
        np.testing.assert_allclose(
            zernike(j, np.hypot(y, x), np.arctan2(y, x)), expected, atol=1e-12, err_msg=str(j)
        )


def test_a_plate_adds_the_phase_within_its_diameter():
    grid = Grid.square(64, 0.1)
    factor = ZernikePlate({2: 0.1, 4: -0.2}, diameter=5.0).transmission(grid, 633e-9)
    y, x = grid.y[34] / 2.5, grid.x[40] / 2.5
    expected = 0.2 * x - 0.2 * math.sqrt(3) * (2 * (y**2 + x**2) - 1)
    assert np.angle(factor[34, 40]) == pytest.approx(expected, abs=1e-12)
    assert factor[0, 0] == 0


def test_the_strehl_ratio_falls_with_the_square_of_the_rms_phase():
    # Strehl ≈ exp(-σ²) (Maréchal); σ⁴ terms of balanced aberrations are under 1e-4 here.
    grid = Grid.square(200, 1.0)
    wave = Field(np.ones((200, 200)), grid, 633e-9)
    plate, plain = (ZernikePlate({11: s}, 180.0)(wave).data for s in (0.2, 0.0))
    assert abs(plate.sum() / plain.sum()) ** 2 == pytest.approx(math.exp(-0.04), abs=3e-4)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: noll_to_nm(0), "Noll's index is 0 but must be a whole number of at least 1"),
        (lambda: ZernikePlate({1.5: 1.0}, 1.0), r"Noll's index is 1\.5"),
        (lambda: ZernikePlate({4: math.nan}, 1.0), "coefficient 4 is nan but must be a finite number"),
        (lambda: ZernikePlate({4: 1.0}, 0.0), "diameter is 0 m"),
    ],
)
def test_impossible_plates_are_refused(build, message):
    with pytest.raises(GeometryError, match=message):
        build()


def test_a_turned_plate_is_the_plate_seen_from_turned_axes(rng):
    """Every order to 5, sine and cosine, off the axis."""
    plate = ZernikePlate({j: rng.normal() for j in range(1, 22)}, 2.0, (0.1, -0.2))
    y, x = rng.uniform(-0.6, 0.6, (2, 50))
    sin, cos = math.sin(0.7), math.cos(0.7)
    turned = plate.turned(0.7).phase(y * cos + x * sin, x * cos - y * sin)
    np.testing.assert_allclose(turned, plate.phase(y, x), atol=1e-12)


def test_an_elliptic_stop_is_as_wide_along_its_direction_as_its_axes_say():
    """Moments of what it lets through: half axes a and b along and across 30 degrees, a²/4 and b²/4."""
    grid, angle = Grid.square(400, 0.01), np.pi / 6
    plate = ZernikePlate({}, 2.0, axes=(0.9, 0.5), direction=angle)
    for each, turn in ((plate, angle), (plate.turned(0.4), angle + 0.4)):
        light = np.abs(each.transmission(grid, 1e-6))
        y, x = grid.y[:, None], grid.x
        along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
        total = light.sum()
        assert total * 1e-4 == pytest.approx(np.pi * 0.9 * 0.5, rel=1e-4)
        moments = [(light * part**2).sum() / total for part in (along, across)]
        assert moments == pytest.approx([0.9**2 / 4, 0.5**2 / 4], rel=1e-3)
        assert abs((light * along * across).sum() / total) < 1e-6


def test_terms_of_an_elliptic_stop_are_stretched_with_it():
    plate = ZernikePlate({8: 0.3, 5: 0.1}, 2.0, axes=(0.9, 0.5))
    round_one = ZernikePlate({8: 0.3, 5: 0.1}, 2.0)
    y, x = np.array([0.1, -0.2]), np.array([0.3, 0.05])
    assert plate.phase(y * 0.5, x * 0.9) == pytest.approx(round_one.phase(y, x))
    turned = plate.turned(0.7)
    sin, cos = np.sin(0.7), np.cos(0.7)
    assert turned.phase(y * cos + x * sin, x * cos - y * sin) == pytest.approx(plate.phase(y, x))


@pytest.mark.parametrize("highest", [66, 153, 171])
def test_terms_summed_by_powers_are_their_sum(highest):
    """Up to order 16 by powers, beyond one by one."""
    rng = np.random.default_rng(1)
    table = {j: float(c) for j, c in zip(range(2, highest + 1), rng.normal(size=highest), strict=False)}
    rho, theta = rng.random(500), rng.random(500) * 2 * np.pi
    expected = sum(c * zernike(j, rho, theta) for j, c in table.items())
    found = ZernikePlate(table, 2.0).phase(rho * np.sin(theta), rho * np.cos(theta))
    assert found == pytest.approx(expected, abs=1e-8)
