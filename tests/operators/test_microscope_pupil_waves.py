"""Sums of a pupil's waves behind lenslets: against sums node by node, without the even grid."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.operators.microscope import pupil_waves
from lumigraph.operators.microscope.pupil_waves import behind, waves_of, window_of
from lumigraph.operators.microscope.waves import bloch, centred, over_cells

CELLS, FINE, NODES = 3, 40, 56
SCOPE = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
    objective={"model": "scalar"}, lenslets={"count": (3, 3)}, sensor={"shape": (58, 58)}
)


@pytest.fixture(scope="module")
def images():
    return SCOPE.pupil_images((5,), farthest=3e-6, accuracy=0.1)


def of_nodes(images, turns):
    """Waves behind the lenslets of every node (nodes, samples)."""
    objective, lenslet = images.objectives[0], images.lenslet
    steepest = objective.numerical_aperture / lenslet.magnification / objective.wavelength * lenslet.pitch
    finest = int(np.floor(FINE / 2 - steepest))
    return over_cells(bloch(lenslet, objective.wavelength, turns, finest, centred(FINE)), turns, CELLS)


@pytest.mark.parametrize(("dtype", "rtol"), [("complex128", 1e-4), ("complex64", 1e-4)])
def test_fields_are_sums_over_the_nodes_of_each_row(images, dtype, rtol):
    objective, lenslet = images.objectives[0], images.lenslet
    waves = waves_of(objective, lenslet, images.layout.sampling, (CELLS, FINE, NODES, dtype))
    rng = np.random.default_rng(0)
    pupils = (rng.normal(size=(2, NODES, NODES)) + 1j * rng.normal(size=(2, NODES, NODES))).astype(dtype)
    found = waves.fields(pupils)
    assert found.dtype == dtype
    pitch = lenslet.pitch / (objective.wavelength * lenslet.magnification)
    along = of_nodes(images, waves.q[0][:, 0] * pitch)
    expected = sum(
        along[row][:, None] * (pupils[:, row] @ of_nodes(images, waves.q[1][row] * pitch))[:, None, :]
        for row in range(NODES)
    )
    assert np.linalg.norm(found - expected) < rtol * np.linalg.norm(expected)


def test_back_is_the_conjugate_transpose_of_fields(images):
    told = (CELLS, FINE, NODES, "complex128")
    waves = waves_of(images.objectives[0], images.lenslet, images.layout.sampling, told)
    rng = np.random.default_rng(1)
    pupils = rng.normal(size=(1, NODES, NODES)) + 1j * rng.normal(size=(1, NODES, NODES))
    fields = rng.normal(size=(1, CELLS * FINE, CELLS * FINE)) + 0.5j
    assert np.vdot(waves.fields(pupils), fields) == pytest.approx(np.vdot(pupils, waves.back(fields)))


def test_round_lenslets_beyond_the_window_send_their_light_into_it(images, monkeypatch):
    """Light is everywhere here, and what the border spreads is left out; without a margin half is wrong."""
    lenslet = replace(images.lenslet, is_round=True)
    ways, told = 2 * [(images.objectives[0], lenslet)], (CELLS, FINE, NODES, "complex128")

    def seen(margin):
        monkeypatch.setattr(pupil_waves, "margin_cells", lambda *given: margin)
        (down, across), rng = behind(*ways, told), np.random.default_rng(3)
        pupil = rng.normal(size=(down.shape[1], across.shape[1]))
        return window_of(*ways, told).forward((down @ pupil @ across.T)[None])

    own, true = pupil_waves.margin_cells(*ways[0]), seen(6)
    assert np.linalg.norm(seen(own) - true) < 0.05 * np.linalg.norm(true)
    assert np.linalg.norm(seen(0) - true) > 0.3 * np.linalg.norm(true)
