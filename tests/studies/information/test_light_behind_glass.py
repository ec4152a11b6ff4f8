"""Light that bounds count behind a lens of glass: as much as enters it, however far away the point."""

import numpy as np
import pytest
from tests.instruments.test_glass import Lens, single

from lumigraph.instruments import glass
from lumigraph.studies.information.points import CameraSource
from lumigraph.units import mm


def test_light_through_a_lens_of_glass_is_that_of_its_entrance_pupil(monkeypatch, tmp_path):
    """Its pupils differ by 1.25: by places before the exit pupil's thin lens light would change by 2.5 %."""
    monkeypatch.setenv("LUMIGRAPH_CACHE", "off")
    monkeypatch.setattr(glass, "Prescription", Lens)
    glass._glass.cache_clear()
    glass._first_order.cache_clear()
    path = tmp_path / "known.zmx"
    path.write_text("not read")
    camera = single(path).replace(sensor={"shape": (61, 61)})
    light = [CameraSource(camera, 1e-2).image(np.array([0, 0, dz])).sum() for dz in (-20 * mm, 20 * mm)]
    assert light[0] == pytest.approx(light[1], rel=5e-3)
