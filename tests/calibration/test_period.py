"""Which of several lattices a picture has."""

import numpy as np
import pytest

from lumigraph.calibration import calibrate
from lumigraph.calibration.period import Request, _best, _Candidate
from lumigraph.calibration.spectrum import Gaps
from lumigraph.calibration.vectors import Vectors
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError


def vectors(lattice):
    column, row = lattice.matrix.T
    return Vectors(row, column, lattice.layout)


def drawn(lattice, every_second):
    """Discs of a lattice; those of every second one, as on a draughtboard, as bright as told."""
    y, x = np.arange(300.0)[:, None], np.arange(300.0)
    i, j = lattice.index(y, x)
    light = np.where((i + j) % 2 == 1, every_second, 1.0)
    return light * (np.hypot(*lattice.offset(y, x)) < 0.4 * lattice.pitch)


@pytest.mark.parametrize(("size", "other"), [(500, 16.0), (800, 32.0)])
def test_beats_of_sharp_edges_with_the_pixels_are_no_lattice(size, other):
    """6.4 px repeat on whole pixels after 32 px: noiseless discs beat with them after 16 px, or 32."""
    lattice = Lattice.square(6.4)
    away = np.hypot(*lattice.offset(np.arange(float(size))[:, None], np.arange(float(size))))
    noise = 0.01 * np.random.default_rng(0).standard_normal((size, size))
    found = calibrate(1e4 * (np.clip(0.95 * 3.2 - away + 0.5, 0, 1) + noise) + 1500)
    assert found.lattice.pitch == pytest.approx(6.4, rel=1e-3), f"not {other} px"


TRUE = Lattice.square(12.3, 0.02, (5.0, 6.0))
COARSER = Lattice.square(12.3 * 2**0.5, 0.02 + np.pi / 4, (5.0, 6.0))


@pytest.mark.parametrize("every_second", [1.0, 0.95])
def test_a_coarser_lattice_whose_own_harmonics_are_faint_is_no_rival(every_second):
    """On clean pictures of 12000² beats and patterns of dead lenslets were lines like any other."""
    pictures = (Gaps(drawn(TRUE, every_second)),) * 2
    ranked = [_Candidate(vectors(TRUE), 100.0), _Candidate(vectors(COARSER), 95.0)]
    found = _best(ranked, Request(), (300, 300), pictures)
    assert found.row == pytest.approx(vectors(TRUE).row)


def test_a_coarser_lattice_that_the_light_has_makes_it_ambiguous():
    """In the light or in the gaps: one of them is enough."""
    plain, draughts = (Gaps(drawn(TRUE, light)) for light in (1.0, 0.4))
    ranked = [_Candidate(vectors(TRUE), 100.0), _Candidate(vectors(COARSER), 95.0)]
    for pictures in ((plain, draughts), (draughts, plain)):
        with pytest.raises(CalibrationError, match=r"2 pitches that are about equally likely, .* 12\.30 px"):
            _best(ranked, Request(), (300, 300), pictures)


def test_a_hexagonal_lattice_has_three_first_harmonics():
    """Those of the true lattice are no fainter than themselves; one of three kinds in turn is."""
    single = Lattice.hex(12.3, 0.02, (5.0, 6.0))
    turned = Lattice.hex(12.3 * 3**0.5, 0.02 + np.pi / 6, (5.0, 6.0))
    y, x = np.arange(300.0)[:, None], np.arange(300.0)
    pictures = (Gaps((np.hypot(*single.offset(y, x)) < 5.0).astype(float)),) * 2
    ranked = [_Candidate(vectors(single), 100.0), _Candidate(vectors(turned), 95.0)]
    assert _best(ranked, Request(), (300, 300), pictures).row == pytest.approx(vectors(single).row)
    with pytest.raises(CalibrationError, match="equally likely"):
        _best(ranked[::-1], Request(), (300, 300), pictures)
