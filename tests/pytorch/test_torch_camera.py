"""A camera as a PyTorch module: images of `simulate`, slopes of central differences."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import FormatError, GeometryError
from lumigraph.scene import Scene

torch = pytest.importorskip("torch")

SMALL = lg.load_camera("thesis-plenoptic-2-m050").replace(
    main_lens={"diameter": "2 mm", "aberrations": {4: 0.1, 6: 0.05, 7: -0.04, 11: 0.03}},
    lenslets={"count": (9, 9), "fill_factor": 0.95},
    sensor={"shape": (121, 121), "fill_factor": 0.9, "pixel_pitch": "4 um"},
)
POINTS = torch.tensor([[[1e-4, -2e-4, 4e-3, 1.0], [-2e-4, 1e-4, 4e-3, 0.5]]], dtype=torch.float64)
KEYS = {
    "wavelength": "0.6 um:0.7 um",
    "object_distance": "118 mm:122 mm",
    "main_lens.focal_length": "59 mm:61 mm",
    "main_lens.diameter": "1.8 mm:2.2 mm",
    "main_lens.aberrations.4": "-0.2:0.4",
    "main_lens.aberrations.6": "-0.3:0.3",
    "main_lens.aberrations.7": "-0.3:0.3",
    "main_lens.aberrations.11": "-0.3:0.3",
    "lenslets.focal_length": "5 mm:5.4 mm",
    "lenslets.pitch": "148 um:153 um",
    "lenslets.fill_factor": "0.9:1",
    "lenslets.magnification": "0.45:0.55",
    "sensor.pixel_pitch": "3.8 um:4.2 um",
    "sensor.fill_factor": "0.8:1",
}


def points_of(some):
    plain = some.detach().numpy()[0]
    return lg.Points(plain[:, :3], plain[:, 3])


def simulated(camera, points):
    with pytest.warns(lg.ParaxialWarning) if camera.model == "paraxial" else pytest.warns(None):
        return lg.simulate(camera, Scene([points])).data


def weights(shape):
    return torch.as_tensor(np.random.default_rng(5).standard_normal(shape))


def differences(model, scene, numbers, step):
    """Central differences of a weighed raw image by some parts, of two steps (Richardson)."""
    found = []
    with torch.no_grad():
        start = model.parts.detach().clone()
        by = weights(model(scene).shape)
        for k in numbers:
            slopes = []
            for size in (step, 2 * step):
                ends = []
                for side in (-size, size):
                    model.parts.copy_(start)
                    model.parts[k] += side
                    ends.append(float((model(scene) * by).sum()))
                slopes.append((ends[1] - ends[0]) / (2 * size))
            found.append((4 * slopes[0] - slopes[1]) / 3)
        model.parts.copy_(start)
    return np.array(found)


def slopes(model, scene):
    model.zero_grad()
    raw = model(scene)
    (raw * weights(raw.shape)).sum().backward()
    return model.parts.grad.numpy()


def test_slopes_by_fourteen_keys_are_those_of_central_differences():
    model = lg.torch.Camera(SMALL, KEYS)
    assert len(model.names) == 14
    found, known = slopes(model, POINTS), differences(model, POINTS, range(14), 2e-3)
    print(found / known - 1)
    np.testing.assert_allclose(found, known, rtol=1e-4)
