"""Images of points under objectives: reference zeros and widths, conservation, aberrations."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from lumigraph.elements.mismatch import Mismatch
from lumigraph.elements.objective import Objective, focus_intensity
from lumigraph.errors import GeometryError

WAVE = 525e-9


def first_minimum(positions, values):
    inner = (values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])
    return positions[1 + int(np.argmax(inner))]


@pytest.mark.parametrize(
    ("na", "n", "lateral", "axial"),
    [(0.5, 1.0, 0.634, 3.920), (0.8, 1.33, 0.395, 1.964), (1.0, 1.33, 0.312, 1.162),
     (1.2, 1.33, 0.254, 0.703), (1.4, 1.515, 0.217, 0.570)],
)  # fmt: skip
def test_first_zeros_of_the_debye_integral(na, n, lateral, axial):
    # Reference numbers to their last digit; the paraxial lateral zero 0.61 λ/NA is 1 % to 6 % off.
    objective = Objective(WAVE, na, n)
    r = np.linspace(0.3, 1.3, 1001) * 0.61 * WAVE / na
    assert first_minimum(r, objective.intensity(r, 0.0, 0.0)) * 1e6 == pytest.approx(lateral, abs=1.2e-3)
    z = np.linspace(0.97, 1.05, 41) * WAVE / (n - math.sqrt(n**2 - na**2))
    on_axis = np.array([float(objective.intensity(0.0, 0.0, dz)) for dz in z])
    assert z[int(np.argmin(on_axis))] * 1e6 == pytest.approx(axial, abs=2.5e-3 * axial)


@pytest.mark.parametrize(
    ("na", "n", "along", "across"),
    [(0.5, 1.0, 0.569, 0.534), (1.2, 1.33, 0.288, 0.212), (1.4, 1.515, 0.253, 0.181)],
)
def test_widths_of_richards_and_wolfs_focus(na, n, along, across):
    objective = Objective(WAVE, na, n)

    def width(uy, ux):
        def off(r):
            return float(focus_intensity(objective, np.array([uy * r]), np.array([ux * r]), 0.0)[0]) - 0.5

        return 2e6 * brentq(off, 1e-9, WAVE / na)

    assert width(0, 1) == pytest.approx(along, abs=1e-3)
    assert width(1, 0) == pytest.approx(across, abs=1e-3)


@pytest.mark.parametrize(("z", "count"), [(0, 1), (10, 5), (25, 19), (50, 61)])
def test_lenslets_that_hold_nine_tenths_of_a_points_light(z, count):
    # 20x/0.5, lenslets of 125 um: reference counts ± 15 %. A paraxial pupil gives 46 at 50 um.
    objective, p, k = Objective(WAVE, 0.5), 125e-6 / 20, 12
    T = 2 * (2 + math.ceil(z * 1e-6 * 0.65 / p)) + 1
    at = (np.arange(T * k) - (T * k - 1) / 2) * p / k
    light = (
        objective.intensity(at[:, None], at[None, :], z * 1e-6).reshape(T, k, T, k).sum((1, 3)) * (p / k) ** 2
    )
    parts = np.cumsum(np.sort(light.ravel())[::-1])
    assert np.searchsorted(parts, 0.9) + 1 == pytest.approx(count, rel=0.15)


@pytest.mark.parametrize("model", ["scalar", "vector", "paraxial"])
@pytest.mark.parametrize("z", [0.0, 3e-6])
def test_the_image_carries_all_of_the_light(model, z):
    objective = Objective(WAVE, 0.8, 1.33, model)
    at = (np.arange(200) - 99.5) * 0.15e-6
    light = objective.intensity(at[:, None], at[None, :], z).sum() * 0.15e-6**2
    assert light == pytest.approx(1.0, abs=0.012)  # the rest is in rings beyond 15 um


def test_a_point_beyond_the_focus_diverges_at_the_native_image():
    # Farther objects have their image before the lenslets: the wave there spreads, exp(+iπr²/(λR)).
    # Inside the blur of 12 um radius the phase is πr²/(λ dz), but for ripples of the aperture's edge.
    r = np.linspace(4e-6, 8e-6, 60)
    for dz in (60e-6, -60e-6):
        phase = np.unwrap(np.angle(Objective(WAVE, 0.2).fields(r, 0.0, dz)[0]))
        assert phase[-1] - phase[0] == pytest.approx(np.pi * (r[-1] ** 2 - r[0] ** 2) / (WAVE * dz), rel=0.2)


def test_moving_the_lenslets_behind_the_image_is_moving_the_object_away():
    # Paraxially a shift a in the image is one of n a/M² in the object, of opposite direction to the image's.
    r = np.linspace(0, 6e-6, 50)
    moved = Objective(WAVE, 0.2, model="paraxial", image_defocus=30e-6).intensity(r, 0.0, 0.0)
    farther = Objective(WAVE, 0.2, model="paraxial").intensity(r, 0.0, 30e-6)
    np.testing.assert_allclose(moved, farther, atol=2e-3 * farther.max())


def test_all_models_agree_for_a_small_aperture():
    r = np.linspace(0, 20e-6, 60)
    images = [
        Objective(WAVE, 0.05, 1.0, model).intensity(r, 0.0, 50e-6)
        for model in ("scalar", "vector", "paraxial")
    ]
    for image in images[1:]:
        np.testing.assert_allclose(image, images[0], atol=3e-3 * images[0].max())


def test_dipoles_along_the_axis_make_a_dark_middle_and_those_across_it_do_not():
    r = np.array([0.0, 0.15e-6])
    axial = Objective(WAVE, 1.2, 1.33, "vector", axial_share=1.0).intensity(r, 0.0, 0.0)
    across = Objective(WAVE, 1.2, 1.33, "vector", axial_share=0.0).intensity(r, 0.0, 0.0)
    assert axial[0] < 1e-6 * axial[1]
    assert across[0] > across[1]


def test_zernike_defocus_moves_the_focus_as_a_depth_does():
    # Noll 4 has 2 sqrt(3) ρ² waves: paraxially a depth of dz changes the phase by -k NA² ρ² dz / (2 n).
    waves, na = 0.25, 0.1
    dz = -2 * 2 * math.sqrt(3) * waves * WAVE / na**2
    plain = Objective(WAVE, na, model="paraxial")
    bent = Objective(WAVE, na, model="paraxial", aberrations={4: waves})
    r = np.linspace(0, 10e-6, 40)
    np.testing.assert_allclose(
        bent.intensity(r, 0.0, 0.0), plain.intensity(r, 0.0, dz), atol=2e-3 * plain.intensity(0, 0, 0)
    )


def test_aberrations_by_harmonics_match_a_direct_integral():
    # Coma, astigmatism and trefoil against the pupil summed point by point.
    objective = Objective(WAVE, 0.5, aberrations={6: 0.08, 7: 0.1, 10: 0.05})
    y, x = np.array([0.3e-6, -0.4e-6, 0.0]), np.array([0.2e-6, 0.5e-6, -0.6e-6])
    n = 401
    u = (np.arange(n) - n // 2) / (n // 2) * 0.5
    q, angle = np.hypot(u[:, None], u), np.arctan2(u[:, None], u)
    from lumigraph.elements.zernike import zernike

    cosine = np.sqrt(np.clip(1 - q**2, 1e-9, None))
    wave = sum(w * zernike(j, q / 0.5, angle) for j, w in objective.terms)
    k = 2 * np.pi / WAVE
    pupil = np.where(q < 0.5, np.exp(1j * (2 * np.pi * wave + k * cosine * 2e-6)) / np.sqrt(cosine), 0)
    direct = [
        abs((pupil * np.exp(1j * k * (u[:, None] * a + u * b))).sum()) ** 2 for a, b in zip(y, x, strict=True)
    ]
    found = objective.intensity(y, x, 2e-6)
    np.testing.assert_allclose(found / found[0], np.array(direct) / direct[0], rtol=0.02)
    assert not objective.is_round


@pytest.mark.parametrize("model", ["scalar", "vector", "paraxial"])
def test_the_plane_by_rows_of_the_pupil_is_that_by_harmonics(model):
    objective = Objective(WAVE, 0.5, model=model, aberrations={6: 0.08, 14: 0.1})
    y = x = np.linspace(-4e-6, 4e-6, 9)
    found = objective.fields(y[:, None], x[None, :], 3e-6)
    single = objective.fields(*np.meshgrid(y, x, indexing="ij"), 3e-6)
    assert np.linalg.norm(found - single) < 1e-5 * np.linalg.norm(single)


@pytest.mark.long
def test_strong_aberrations_have_as_many_harmonics_as_they_need():
    # With 64 directions for all, the harmonics of this wave of tetrafoil were wrong by a fifth.
    objective = Objective(WAVE, 0.5, aberrations={14: 0.7, 10: 0.7})
    y = x = np.linspace(-12e-6, 12e-6, 5)
    found = objective.fields(y[:, None], x[None, :], 3e-6)
    single = objective.fields(*np.meshgrid(y, x, indexing="ij"), 3e-6)
    assert np.linalg.norm(found - single) < 1e-5 * np.linalg.norm(single)


def test_aberrations_spread_rays_by_the_wavefronts_slope():
    # Z4 = sqrt(3) (2 ρ² - 1) has the slope 4 sqrt(3) ρ per radius; half of the light is within ρ² = 1/2.
    one = Objective(WAVE, 0.5, aberrations={4: 0.5})
    assert one.spread() == pytest.approx(2 * math.sqrt(3) * WAVE / 0.5, rel=0.02)
    assert one.spread(0.5) == pytest.approx(math.sqrt(6) * WAVE / 0.5, rel=0.03)
    assert Objective(WAVE, 0.5).spread() == 0


def test_a_mismatch_spreads_the_focus_and_a_matched_medium_does_not():
    plain = Objective(WAVE, 1.2, 1.33)
    same = Objective(WAVE, 1.2, 1.33, mismatch=Mismatch(1.33, 20e-6))
    other = Objective(WAVE, 1.2, 1.33, mismatch=Mismatch(1.38, 20e-6))
    peak = float(plain.intensity(0, 0, 0))
    assert float(same.intensity(0, 0, 0)) == pytest.approx(peak, rel=1e-6)
    assert float(other.intensity(0, 0, 0)) < 0.7 * peak


def test_a_thicker_coverslip_is_an_aberration_and_the_designs_own_is_none():
    def peak(thickness):
        glass = Mismatch(1.33, 0.0, (1.52, thickness), (1.52, 170e-6))
        return float(Objective(WAVE, 1.0, 1.33, mismatch=glass).intensity(0, 0, 0))

    assert peak(170e-6) == pytest.approx(float(Objective(WAVE, 1.0, 1.33).intensity(0, 0, 0)), rel=1e-6)
    assert peak(190e-6) < 0.8 * peak(170e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"numerical_aperture": 1.4}, "aperture 1.4 is not below the refractive index 1.33"),
        ({"model": "ray"}, "model is 'ray' but must be one of scalar, vector, paraxial, rays"),
        ({"model": "rays", "aberrations": {11: 0.1}}, "model 'rays' has no aberrations"),
        ({"model": "rays", "image_defocus": 1e-6}, "model 'rays' has no .* lenslet offset"),
        ({"axial_share": 2.0}, "axial_share is 2 but must be from 0 to 1"),
        ({"aberrations": {0: 0.1}}, "Noll's index is 0"),
        ({"wavelength": float("nan")}, "wavelength is nan"),
    ],
)
def test_bad_objectives_are_refused(change, message):
    with pytest.raises(GeometryError, match=message):
        Objective(**{"wavelength": WAVE, "numerical_aperture": 1.2, "index": 1.33, **change})


def test_rays_have_no_field():
    with pytest.raises(GeometryError, match="model 'rays' has no field"):
        Objective(WAVE, 1.2, 1.33, "rays").fields(0.0, 0.0, 0.0)


def test_bad_layers_are_refused():
    with pytest.raises(GeometryError, match="focus_depth is -1e-06 m"):
        Mismatch(1.33, -1e-6)
    with pytest.raises(GeometryError, match="give both coverslip= and design="):
        Mismatch(1.33, 0.0, (1.5, 1e-4))
