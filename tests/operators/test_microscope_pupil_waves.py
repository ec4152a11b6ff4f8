"""Sums of a pupil's waves behind lenslets: against sums node by node, without the even grid."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.operators.microscope_pupil_waves import waves_of
from lumigraph.operators.microscope_waves import bloch, centred, over_cells

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
