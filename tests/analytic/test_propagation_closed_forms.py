"""Propagation against closed forms: Rayleigh-Sommerfeld on the axis, Gaussian beam, Talbot, Airy."""

import math

import numpy as np
import pytest

import lumigraph.studies.thesis.methods  # noqa: F401 (adds the thesis' methods, which are tested too)
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.propagation import METHODS, propagate
from lumigraph.units import mm, nm, um

WAVELENGTH = 633 * nm


def radius(grid):
    return np.hypot(grid.y[:, None], grid.x)


def gaussian_beam(grid, distance, waist=0.2 * mm, wavelength=WAVELENGTH):
    """Paraxial Gaussian beam from its waist: width, curvature, Gouy phase and carrier (Siegman 17.1)."""
    rayleigh = math.pi * waist**2 / wavelength
    r2 = radius(grid) ** 2
    q_ratio = 1 / (1 + 1j * distance / rayleigh)
    carrier = np.exp(2j * np.pi * math.fmod(distance / wavelength, 1))
    return carrier * q_ratio * np.exp(-r2 / waist**2 * q_ratio)


@pytest.mark.parametrize("distance", [0.15, 0.3, 0.6])
def test_on_axis_field_behind_a_hard_pupil_is_rayleigh_sommerfeld(distance):
    # Exact: exp(ikz) - z/s exp(iks), s² = z² + a² (Osterberg and Smith 1961). The staircase of hard
    # pixels leaves 2 %; a distance 2 % off would move the value by more than 0.1 at 0.15 m.
    a, grid = 1 * mm, Grid.square(500, 5 * um)
    pupil = Field((radius(grid) <= a).astype(complex), grid, WAVELENGTH)
    k, s = 2 * math.pi / WAVELENGTH, math.hypot(distance, a)
    exact = 1 - distance / s * np.exp(1j * k * a**2 / (s + distance))
    exact *= np.exp(1j * k * math.fmod(distance, WAVELENGTH))
    found = propagate(pupil, distance, pad=3, grid=grid.resized(1)).data[0, 0]
    assert abs(found - exact) < 0.03


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("distance", [63 * mm, -63 * mm])
def test_a_gaussian_beam_keeps_width_curvature_gouy_phase_and_carrier(method, distance):
    # Fresnel methods are exact up to the beam's tail at the edge; the others differ from the paraxial beam
    # by k λ⁴ f⁴ z / 8, here 1e-7. A missing Gouy phase would be 0.3.
    grid = Grid.square(200, 10 * um)
    own = {"grid": grid} if method in ("zoom", "fresnel") else {}
    found = propagate(Field(gaussian_beam(grid, 0.0), grid, WAVELENGTH), distance, method, **own)
    tolerance = 1e-10 if "fresnel" in method else 3e-7
    assert np.abs(found.data - gaussian_beam(grid, distance)).max() < tolerance


@pytest.mark.parametrize("shape", [(200, 200), (201, 180)])
@pytest.mark.parametrize("sign", [1, -1])
def test_one_step_fresnel_puts_a_gaussian_beam_on_its_own_pitch(shape, sign):
    grid, distance = Grid(shape, (10 * um, 11 * um), (0.3 * mm, -0.2 * mm)), sign * 100 * mm
    waist = gaussian_beam(Grid(shape, grid.pitch), 0.0)
    found = propagate(Field(waist, grid, WAVELENGTH), distance, "fresnel")
    assert found.grid.pitch == pytest.approx([WAVELENGTH * 0.1 / size for size in grid.size])
    assert found.grid.center == grid.center
    expected = gaussian_beam(Grid(shape, found.grid.pitch), distance)
    assert np.abs(found.data - expected).max() < 1e-9


def test_a_grating_images_itself_at_the_exact_talbot_distance():
    # λ / (1 - sqrt(1 - λ²/d²)); the paraxial 2d²/λ is λ/2 longer, which leaves 4e-4 of phase.
    period, count = 40 * um, 10
    grid = Grid.square(200, period * count / 200)
    talbot = WAVELENGTH / (1 - math.sqrt(1 - (WAVELENGTH / period) ** 2))
    grating = np.broadcast_to(1 + np.cos(2 * np.pi * grid.x / period), grid.shape).astype(complex)
    with pytest.warns(UserWarning, match="aliases"):
        found = propagate(Field(grating, grid, WAVELENGTH), talbot, "angular_spectrum", pad=0).data
    found = found * np.exp(-2j * np.pi * math.fmod(talbot / WAVELENGTH, 1))
    assert np.abs(found - grating).max() < 1e-9
    with pytest.warns(UserWarning, match="aliases"):
        half = propagate(Field(grating, grid, WAVELENGTH), talbot / 2, "angular_spectrum", pad=0)
    shifted = 1 - np.cos(2 * np.pi * grid.x / period)
    assert np.abs(half.intensity - shifted**2).max() < 1e-9


@pytest.mark.parametrize(("diameter", "zero", "tolerance"), [(5 * mm, 48.8, 0.3), (3.6 * mm, 67.8, 0.4)])
@pytest.mark.parametrize("method", ["band_limited", "zoom"])
def test_two_f_image_of_a_point_has_its_first_zero_where_airy_says(diameter, zero, tolerance, method):
    # 1.22 λ z / D at z = 316 mm. The thesis prints 67 µm for D = 5 mm, which is the value of D = 3.6 mm.
    focal_length, distance, whole = 158 * mm, 316 * mm, Grid.square(2000, 5 * um)
    pupil = whole.resized(1002)
    r2 = radius(pupil) ** 2
    lens = np.exp(-1j * np.pi * r2 / (WAVELENGTH * focal_length)) * (r2 <= diameter**2 / 4)
    point = Field(np.ones((1, 1), np.complex64), whole.resized(1), WAVELENGTH)
    field = propagate(point, distance, pad=1999, grid=pupil) * lens.astype(np.complex64)
    line = Grid((1, 401), (1 * um, 0.5 * um)) if method == "zoom" else whole.resized((1, 41))
    image = propagate(field, distance, method, grid=line)
    x, centre = line.x, line.shape[1] // 2
    amplitude = (image.data[0] / image.data[0, centre]).real
    first = centre + int(np.argmax(amplitude[centre:] < 0))
    share = amplitude[first - 1] / (amplitude[first - 1] - amplitude[first])
    assert (x[first - 1] + share * (x[first] - x[first - 1])) / um == pytest.approx(zero, abs=tolerance)
