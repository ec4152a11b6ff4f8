"""Refocus factors of a microscope's views in metres: textured planes at known depths, by wave optics."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.depth import defocus, epi
from lumigraph.errors import GeometryError


@pytest.fixture(scope="module")
def scope():
    return lg.LightFieldMicroscope(
        wavelength="550 nm", objective={"magnification": 20, "numerical_aperture": 0.45},
        lenslets={"pitch": "300 um", "focal_length": "6 mm", "count": (25, 25)},
        sensor={"pixel_pitch": "18.75 um"},
    )  # fmt: skip


def views_of(scope, dz):
    """Views of a plane at a depth, with waves of two to ten lenslets."""
    operator = scope.operator((dz,), 3, accuracy=1e-2)
    grid, rng = operator.object_grid, np.random.default_rng(2)
    ky, kx = rng.uniform(-0.5, 0.5, (2, 40, 1, 1)) * 2 * np.pi / (2 * scope.lenslet_size)
    waves = np.cos(ky * grid.y[:, None] + kx * grid.x + rng.uniform(0, 6, (40, 1, 1))).sum(0)
    scene = np.maximum(1 + 0.12 * waves, 0).astype(np.float32)[None]
    return lg.decode(np.maximum(operator.forward(scene), 0), scope.calibration)


@pytest.mark.parametrize("dz", [-80e-6, pytest.param(80e-6, marks=pytest.mark.long)])
def test_the_depth_of_a_textured_plane_comes_out_in_metres_positive_farther(scope, dz):
    views = views_of(scope, dz)
    found = defocus(epi(views), views, scope.depth_per_alpha)
    inner = np.asarray(found.values)[6:-6, 6:-6]
    # Diffraction at lenslets of 100, 200 and 300 um draws it towards the focus by 15, 5, 3 %; with sin θ in
    # the place of tan θ it would be 4 % beyond the plane.
    assert 0.94 < float(np.median(inner)) / dz < 1.0
    assert found.unit == "m"


def test_configurations_without_views_are_refused():
    with pytest.raises(GeometryError, match=r"of configuration '1\.0', not 'fourier'"):
        lg.LightFieldMicroscope.from_catalogue("lfm-fourier").depth_per_alpha(0.1)
