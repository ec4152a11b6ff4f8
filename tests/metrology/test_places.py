"""Pitch and rotation of drawn white images, and whether their errors hold."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.calibration.centres import Spots
from lumigraph.calibration.fitting import fit
from lumigraph.core.calibration import Calibration
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards.places import WIDTH, pitch_and_rotation, places

SHAPE = (230, 250)


def drawn(lattice, warp=None, reach=7):
    """Bright lenslets with soft gaps, no finer than pixels show; none beyond `reach` from the first."""
    y, x = np.indices(SHAPE).astype(float)
    if warp is not None:
        y, x = np.moveaxis(warp.removed(np.stack([y, x], -1)), -1, 0)
    u, v = np.einsum(
        "ka,ayx->kyx", np.linalg.inv(lattice.matrix), np.stack([y, x]) - np.reshape(lattice.origin, (2, 1, 1))
    )
    lit = np.maximum(np.abs(u), np.abs(v)) < reach + 0.5
    gaps = [np.exp(-6 * (1 + np.cos(2 * np.pi * w))) for w in (u, v)]
    return lit * (1 - 0.4 * gaps[0]) * (1 - 0.4 * gaps[1]) * (1 - 0.2 * (y - 115) ** 2 / 115**2)


def known(lattice, reach=7):
    """What a calibration may know: its pitch is 0.3 % off."""
    index = np.stack(np.mgrid[-reach : reach + 1, -reach : reach + 1], -1).reshape(-1, 2)
    wrong = tuple(tuple(1.003 * v for v in vector) for vector in lattice.basis)
    model = replace(lattice, basis=wrong)
    return Calibration(model, SHAPE, index, model.position(index), 0.01)


def scores(lattice, rng, warp=None):
    """Errors of pitch and rotation over their standard deviations."""
    white = drawn(lattice, warp) + rng.normal(0, 0.01, SHAPE)
    found = pitch_and_rotation(places(white, known(lattice)))
    true = (lattice.pitch, lattice.rotation)
    return [(value - one) / error for (value, error), one in zip(found, true, strict=True)]


def test_pitch_and_rotation_are_right_within_their_errors():
    """Pitches close to whole pixels and far from them; the array ends inside the picture.

    Straight lines through the centres that `calibrate` finds are off by up to 290 of these deviations.
    """
    rng, found = np.random.default_rng(3), []
    for pitch in (12.02, 13.3, 13.96):
        for turn in (0.0, 0.01):
            lattice = lg.Lattice.square(pitch, turn, tuple(rng.uniform(112, 125, 2)))
            found.append(scores(lattice, rng))
    assert np.sqrt(np.mean(np.square(found))) < 1.6  # 12 of them: 1 ± 0.2


@pytest.mark.parametrize("layout", ["square", "hex"])
def test_errors_are_those_of_lenslets_with_neighbours_that_err_as_one(layout):
    """Of 13 x 13 lenslets; errors of lines through all of them are 1.4 times too small."""
    rng, index = np.random.default_rng(5), np.stack(np.mgrid[:13, :13], -1).reshape(-1, 2)
    lattice = getattr(lg.Lattice, layout)(14.0, 0.0, (20.0, 20.0))
    points = lattice.position(index)
    away = ((points[:, None] - points) ** 2).sum(-1) / lattice.pitch**2
    mixed = np.linalg.cholesky(np.exp(-away / (4 * WIDTH**2)) + 1e-9 * np.eye(169))
    model, found = Calibration(lattice, SHAPE, index, points, 0.0), []
    for _ in range(150):
        spots = Spots(index, points + 1e-3 * mixed @ rng.normal(0, 1, points.shape), np.ones(169))
        parts = pitch_and_rotation(fit(spots, model, warped=False))
        found.append([(parts[0][0] - 14.0) / parts[0][1], parts[1][0] / parts[1][1]])
    rms = np.sqrt(np.mean(np.square(found), axis=0))
    assert rms == pytest.approx([1, 1], abs=0.15)  # 1 ± 0.06


def test_a_distortion_is_taken_out():
    lattice = lg.Lattice.square(13.3, 0.003, (114.0, 124.0))
    warp = Warp((114.5, 124.5), radial=8e-7)  # 0.8 px at the border of the array
    assert np.abs(scores(lattice, np.random.default_rng(5), warp)).max() < 3


def test_too_few_lenslets_are_refused():
    lattice = lg.Lattice.square(13.3, 0.0, (115.0, 125.0))
    with pytest.raises(CalibrationError, match=r"9 lenslets are 3 pitches or more inside .* 12 are needed"):
        places(drawn(lattice, reach=4), known(lattice, 4))
