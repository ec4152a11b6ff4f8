"""Against POPPY, as a black box: a point image through clear and aberrated pupils. Skipped without it."""

import numpy as np
import pytest

from lumigraph.instruments import SingleLensCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.units import mm, nm, um

poppy = pytest.importorskip("poppy")
pytestmark = pytest.mark.filterwarnings("ignore")

WAVELENGTH, PIXELS, OVERSAMPLE = 633 * nm, 41, 8


@pytest.mark.parametrize("waves", [{}, {4: 0.12}, {11: 0.08}, {7: 0.1, 6: 0.05}, {7: 0.05, 8: 0.1, 5: 0.04}])
def test_a_points_image_through_zernike_phases_is_theirs(waves):
    """Peak-normalised pixel values; Noll's indices, order of axes and signs must agree, unmirrored."""
    camera = SingleLensCamera(
        wavelength=WAVELENGTH,
        object_distance=316 * mm,
        main_lens={"focal_length": 158 * mm, "diameter": 5 * mm, "aberrations": waves},
        sensor={"pixel_pitch": 4 * um, "shape": (PIXELS, PIXELS)},
    )
    ours = simulate(camera, targets.points([(0, 0)])).data
    system = poppy.OpticalSystem(oversample=OVERSAMPLE, npix=512)
    system.add_pupil(poppy.CircularAperture(radius=2.5 * mm))
    if waves:
        coefficients = [waves.get(j, 0.0) * WAVELENGTH for j in range(1, 12)]
        system.add_pupil(poppy.ZernikeWFE(radius=2.5 * mm, coefficients=coefficients))
    scale = np.degrees(4 * um / camera.separation) * 3600
    system.add_detector(pixelscale=scale, fov_pixels=PIXELS)
    fine = system.calc_psf(WAVELENGTH, normalize="last")[0].data
    theirs = fine.reshape(PIXELS, OVERSAMPLE, PIXELS, OVERSAMPLE).mean((1, 3))
    # 0.0015 is measured for the last: their pupil's edge is that of samples, 1/512 of the diameter.
    assert np.abs(ours / ours.max() - theirs / theirs.max()).max() < 3e-3
