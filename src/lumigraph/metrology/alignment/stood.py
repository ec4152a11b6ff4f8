r"""White images of a bench as it stands, by wave optics.

The pupil of a microscope is as if at infinity: its micro-images keep their places when the array is raised
or tilted, and only their widths :math:`2 (NA/M)\,(b + z)` follow the local height z of the array.
"""

import math
from collections.abc import Mapping

import numpy as np

from lumigraph.instruments import LensletCamera
from lumigraph.instruments.telecentric import is_telecentric
from lumigraph.metrology.alignment.setup import STATES
from lumigraph.metrology.twin import CAUSES, BenchModel

_NODES = np.array([-1.0, 0.0, 1.0])
"""Local heights of a tilted array, over the largest, that images are made for; the rest is interpolated."""


def white_of(camera: LensletCamera, state: np.ndarray, *, around: float = 0.0) -> np.ndarray:
    """White image (y, x) of a camera with `STATES` (10,) out of place, without noise.

    Parameters
    ----------
    camera
        What the bench is meant to be.
    state
        What is out of place.
    around
        Width of the sensor's surroundings [m] from which light may be shifted into the picture.
    """
    values: dict[str, float] = dict(zip(STATES, np.asarray(state, float).tolist(), strict=True))
    margin = math.ceil(around / camera.sensor.pixel_pitch)
    model = BenchModel(_stood(camera, values, margin))
    tilted = is_telecentric(camera) and any((values["tilt_y"], values["tilt_x"]))
    light = _tilted(model, values) if tilted else model.white([values[one] for one in CAUSES])
    return light[margin : light.shape[0] - margin, margin : light.shape[1] - margin]


def _stood(camera: LensletCamera, values: Mapping[str, float], margin: int) -> LensletCamera:
    """The camera with distances and a pitch that are not those of `CAUSES`, and more pixels around."""
    built = {
        "separation": camera.separation + values["separation"],
        "lenslet_distance": camera.lenslet_distance + values["sensor"],
    }
    return camera.replace(
        lenslets={"pitch": camera.lenslets.pitch * (1 + values["pitch"])} if values["pitch"] else {},
        built=built, sensor={"shape": tuple(n + 2 * margin for n in camera.sensor.shape)},
        main_lens={"diameter": camera.pupil_diameter},
    )  # fmt: skip


def _tilted(model: BenchModel, values: Mapping[str, float]) -> np.ndarray:
    """White image (y, x) whose micro-images have the widths of the array's local heights."""
    sensor = model.camera.sensor
    y, x = ((np.arange(n) - n // 2) * sensor.pixel_pitch for n in sensor.shape)
    height = math.tan(values["tilt_y"]) * y[:, None] + math.tan(values["tilt_x"]) * x
    largest = float(np.abs(height).max())
    light = np.zeros(sensor.shape)
    for k, node in enumerate(_NODES):
        others = np.delete(_NODES, k)
        weight = np.prod([(height / largest - one) / (node - one) for one in others], axis=0)
        raised = dict(values) | {"height": values["height"] + node * largest}
        light += weight * model.white([raised[one] for one in CAUSES])
    return light
