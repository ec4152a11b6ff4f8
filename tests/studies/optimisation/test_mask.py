"""A phase mask for extended depth, found from noise, beside the cubic that is known; its gradients."""

import math

import numpy as np
import pytest

from lumigraph.elements.zernike import zernike
from lumigraph.errors import GeometryError
from lumigraph.studies.optimisation.mask import MaskedPupil, depth_mask


def test_gradients_are_those_of_central_differences(rng):
    pupil = MaskedPupil(tuple(range(4, 16)), 1.5, 1e-3)
    waves, step = rng.normal(0, 0.1, 12), 1e-5
    gradient = pupil.error(waves)[1]
    for k in range(12):
        move = np.eye(12)[k] * step
        slope = (pupil.error(waves + move)[0] - pupil.error(waves - move)[0]) / (2 * step)
        assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-7)


def test_a_clear_pupil_in_focus_has_the_transfer_function_of_a_disc():
    """In closed form, to the pupil's coarse edge."""
    found = MaskedPupil((4,), 1.0).transfer(np.zeros(1))[4, 0].real
    part = np.arange(30) / 32
    assert found[:30] == pytest.approx(
        2 / math.pi * (np.arccos(part) - part * np.sqrt(1 - part**2)), abs=0.02
    )


def test_a_wave_of_defocus_is_one_at_the_edge_of_the_pupil():
    """Noll 4 is √3 (2ρ² - 1): a wave at the edge, which is the last of the range, is 1/(2√3) rms."""
    pupil = MaskedPupil((4,), 1.0)
    ahead, back = pupil.transfer(np.zeros(1)), pupil.transfer(np.array([-1 / (2 * math.sqrt(3))]))
    assert back[-1] == pytest.approx(ahead[4], abs=1e-9)


def test_what_cannot_be_is_refused(rng):
    with pytest.raises(GeometryError, match="from 4 on: others move images"):
        depth_mask(1.0, (2, 5), rng=rng)
    with pytest.raises(GeometryError, match="defocus is 0"):
        depth_mask(0.0, rng=rng)
    with pytest.raises(GeometryError, match="starts"):
        depth_mask(1.0, starts=0, rng=rng)


def cubics():
    """Samples (y, x) of the pupil, and on them a³ + b³ along and across 360 directions."""
    at = np.linspace(-1, 1, 81)
    y, x = (v[np.hypot(at[:, None], at) < 1] for v in np.meshgrid(at, at, indexing="ij"))
    turns = np.radians(np.arange(0, 180, 0.5))
    a, b = (np.outer(np.cos(turns + d), x) + np.outer(np.sin(turns + d), y) for d in (0, np.pi / 2))
    return y, x, free(a**3 + b**3, y, x)


def free(phase, y, x):
    """Phases (..., k) without what tilt and piston explain, of length 1."""
    basis = np.linalg.qr(np.stack([np.ones_like(y), y, x], 1))[0]
    rest = phase - (phase @ basis) @ basis.T
    return rest / np.linalg.norm(rest, axis=-1, keepdims=True)


@pytest.mark.long
def test_the_mask_for_extended_depth_that_noise_leads_to_is_the_cubic():
    """All twelve terms of the second to fourth order are free, from 6 drawn starts; two waves either way."""
    found = depth_mask(2.0, rng=np.random.default_rng(1))
    y, x, known = cubics()
    phase = sum(w * zernike(j, np.hypot(y, x), np.arctan2(y, x)) for j, w in found.terms.items())
    assert np.abs(known @ free(phase, y, x)).max() > 0.95
    assert found.error < 0.75 * found.without
