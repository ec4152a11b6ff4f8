"""Raw images without gaps, whose micro-images meet at known borders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from data_folder import real
from lumigraph import io
from lumigraph.calibration import aligned, calibrate
from lumigraph.calibration.borders import border
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError

SHAPE = (420, 460)


def gapless(lattice, rng, shape=SHAPE):
    """Micro-images of a smooth scene, each of which shows more of it than its share, turned round."""
    paint = ndimage.gaussian_filter(rng.standard_normal(shape), 8)
    paint = 0.3 + (paint - paint.min()) / np.ptp(paint)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    dy, dx = lattice.offset(y, x)
    return ndimage.map_coordinates(paint, [y - 2.5 * dy, x - 2.5 * dx], order=1, mode="reflect")


def known(lattice, shape=SHAPE):
    indices = lattice.indices((0, shape[0] - 1), (0, shape[1] - 1))
    return Calibration(lattice, shape, indices, lattice.position(indices), 0.0)


@pytest.mark.parametrize("layout", ["hex", "square"])
@pytest.mark.parametrize("move", [(2.2, -1.7), (0.0, 0.0), (-3.4, 2.5)])
def test_a_shifted_lattice_is_moved_to_the_borders(layout, move, rng):
    lattice = getattr(Lattice, layout)(21.3, 0.01, (203.4, 214.8))
    found = aligned(known(lattice.moved(*move)), gapless(lattice, rng))
    np.testing.assert_allclose(found.lattice.origin, lattice.origin, atol=0.3)
    np.testing.assert_allclose(found.centers, found.position(found.indices), atol=1e-9)
    assert "moved by (" in found.notes[-1]


def test_what_is_far_off_or_shows_no_borders_stays_where_it_is(rng):
    lattice = Lattice.hex(21.3, 0.01, (203.4, 214.8))
    far = known(lattice.moved(9.0, 3.0))
    assert aligned(far, gapless(lattice, rng)) is far
    for picture in (np.ones(SHAPE), rng.random(SHAPE), ndimage.gaussian_filter(rng.random(SHAPE), 3)):
        assert aligned(far, picture) is far
    stretched = replace(far, lattice=Lattice.hex(22.0, 0.01, (203.4, 214.8)))
    assert aligned(stretched, gapless(lattice, rng)) is stretched
    with pytest.raises(CalibrationError, match="10 x 10 pixels but its calibration is for 420 x 460"):
        aligned(far, np.ones((10, 10)))


def test_the_real_crop_is_found_by_its_maker_s_file_and_by_itself_alike():
    """The file's lattice is 3.6 px off on the cropped picture; both ways now agree to a tenth of a pixel."""
    raw = io.open(real("raytrix_r42_multifocus", "sc2_klein.png"))
    given = io.open(real("raytrix_r42_multifocus", "sc2_klein.xml"), shape=raw.shape)
    moved, alone = aligned(given, raw), calibrate(raw)
    assert np.hypot(*np.subtract(moved.lattice.origin, given.lattice.origin)) == pytest.approx(3.6, abs=0.3)
    assert np.hypot(*moved.lattice.offset(*alone.lattice.origin)) < 0.3
    assert alone.lattice.kinds == 3
    assert alone.lattice.pitch == pytest.approx(34.865, abs=0.1)


def test_pictures_whose_quarters_are_not_alike_are_placed(rng):
    """An odd number of pixels, where a quarter's mean cell would be a sample larger than another's."""
    model = known(Lattice.square(58.2), (203, 203))
    assert np.isfinite(border(rng.random((203, 203), np.float32), model).clearness)
