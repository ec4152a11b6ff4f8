"""What a type checker says of the values that verbs return; `make lint` runs one on it."""

from typing import Any, assert_type

import numpy as np

import lumigraph as lg
from lumigraph.core.linear import Linear
from lumigraph.io.formats import Noun


def arrays_keep_their_type(views: lg.LightField[np.ndarray], raw: lg.RawImage[np.ndarray]) -> None:
    """Of a light field of NumPy arrays comes a NumPy array."""
    assert_type(lg.refocus(views, 1.1), np.ndarray)
    assert_type(lg.refocus_stack(views, [1.0, 1.1]), np.ndarray)
    assert_type(lg.refocus_fourier(views, 1.1), np.ndarray)
    assert_type(lg.sub_aperture(views, 0, 0), np.ndarray)
    assert_type(lg.view_path(views), np.ndarray)
    assert_type(lg.reduce_aperture(views, 0.5), lg.LightField[np.ndarray])
    assert_type(views.view(0, 0), np.ndarray)
    assert_type(raw.data, np.ndarray)
    assert_type(np.asarray(raw), np.ndarray)


def verbs_return_nouns(raw: lg.RawImage, calibration: lg.Calibration, camera: lg.PlenopticCamera) -> None:
    """What was decorated or looked up still has its type, and its parameters theirs."""
    assert_type(lg.decode(raw, calibration, directions=9), lg.LightField)
    assert_type(lg.prepare(raw), lg.PreparedImage)
    assert_type(lg.calibrate(raw), lg.Calibration)
    assert_type(lg.simulate(camera, lg.targets.white()), lg.RawImage)
    assert_type(lg.devignette(raw, raw), lg.RawImage)
    assert_type(lg.RawImage(np.ones((2, 2))).data, np.ndarray[tuple[int, int], np.dtype[np.float64]])
    assert_type(lg.LightField.from_xarray(raw), lg.LightField)
    lg.decode(raw, calibration, direction=9)  # pyright: ignore[reportCallIssue]


def files_hold_a_noun_or_the_one_asked_for() -> None:
    """Of the noun that is asked for, or one of those that files can hold."""
    assert_type(lg.open("white.png", lg.RawImage), lg.RawImage)
    assert_type(lg.open("views.zarr", lg.LightField).view(0, 0), Any)
    assert_type(lg.open("file"), Noun)


def volumes_keep_their_arrays(
    raw: lg.RawImage[np.ndarray], data: np.ndarray, operator: Linear, frames: list[np.ndarray]
) -> None:
    """Of a raw image a volume or a picture, of an array an array."""
    assert_type(lg.deconvolve(data, operator), np.ndarray)
    assert_type(lg.deconvolve(raw, operator), lg.Volume[np.ndarray] | lg.RawImage[np.ndarray] | np.ndarray)
    assert_type(next(lg.deconvolve_series(frames, operator)), np.ndarray)
