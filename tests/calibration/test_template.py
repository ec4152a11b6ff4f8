"""Centres by the mean micro-image, of which many share a fit."""

import numpy as np

from lumigraph.calibration import template
from lumigraph.calibration.centres import measure
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice


def test_many_micro_images_are_where_each_by_itself_would_be(monkeypatch):
    """More than 4096 share fits by where they stand between the pixels."""
    lattice = Lattice.square(6.3, 0.01, (3.0, 4.0))
    y, x = np.arange(430.0)[:, None], np.arange(430.0)
    picture = np.clip(0.9 * 3.15 - np.hypot(*lattice.offset(y, x)) + 0.5, 0, 1).astype(np.float32)
    none = np.zeros((0, 2))
    model = Calibration(lattice, picture.shape, none.astype(int), none, 0.0)
    spots = measure(picture, model)
    assert len(spots.indices) > template._PHASES**2
    shared = template.sharpened(picture, spots, model).centers
    monkeypatch.setattr(template, "_PHASES", 1000)
    alone = template.sharpened(picture, spots, model).centers
    assert np.median(np.hypot(*(shared - alone).T)) < 3e-3
    assert np.median(np.hypot(*(shared - lattice.position(spots.indices)).T)) < 0.02
