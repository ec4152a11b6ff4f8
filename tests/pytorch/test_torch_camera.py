"""A camera as a PyTorch module: images of `simulate`, slopes of central differences."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.scene import Scene

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

SMALL = lg.load_camera("thesis-plenoptic-2-m050").replace(
    main_lens={"diameter": "1.5 mm", "aberrations": {4: 0.1, 6: 0.05, 7: -0.04, 11: 0.03}},
    lenslets={"count": (7, 7), "fill_factor": 0.95},
    sensor={"shape": (61, 61), "fill_factor": 0.9, "pixel_pitch": "6 um"},
)
PLACES = [[1e-4, -2e-4, 4e-3, 1.0], [-2e-4, 1e-4, 4e-3, 0.5]]
KEYS = {
    "wavelength": "0.6 um:0.7 um",
    "object_distance": "118 mm:122 mm",
    "main_lens.focal_length": "59 mm:61 mm",
    "main_lens.diameter": "1.4 mm:1.6 mm",
    "main_lens.aberrations.4": "-0.2:0.4",
    "main_lens.aberrations.6": "-0.3:0.3",
    "main_lens.aberrations.7": "-0.3:0.3",
    "main_lens.aberrations.11": "-0.3:0.3",
    "lenslets.focal_length": "5 mm:5.4 mm",
    "lenslets.pitch": "148 um:153 um",
    "lenslets.fill_factor": "0.9:1",
    "lenslets.magnification": "0.45:0.55",
    "sensor.pixel_pitch": "5.8 um:6.2 um",
    "sensor.fill_factor": "0.8:1",
}
SMOOTH = 1e-4
"""Of slopes beside differences of two steps, between which cameras choose their sampling anew."""


def points(**more):
    return torch.tensor([PLACES], dtype=torch.float64, **more)


def weighed(raw):
    return (raw * torch.as_tensor(np.random.default_rng(5).standard_normal(raw.shape))).sum()


def slope(function, tensor, along, step):
    """Derivative along a direction by differences of two steps."""
    with torch.no_grad():
        still, found = tensor.clone(), []
        for side in (-2, -1, 1, 2):
            tensor.copy_(still + side * step * along)
            found.append(float(function()))
        tensor.copy_(still)
    return (8 * (found[2] - found[1]) - (found[3] - found[0])) / (12 * step)


@pytest.mark.parametrize(
    ("change", "accuracy"),
    [
        ({"lenslets": {"layout": "hex"}}, 3e-3),  # at 1e-2 simulate samples them otherwise: 9e-5
        ({"model": "exact", "main_lens": {"aberrations": {}}}, 1e-2),
        ({"lenslets": {"single": {5: {"focal_change": 0.02}, 24: {"focal_change": 0.03}}}}, 1e-2),
    ],
    ids=["hexagons", "exact", "single lenslets"],
)
@pytest.mark.filterwarnings("ignore:an accuracy of")
def test_raw_images_are_those_of_simulate(change, accuracy):
    camera = SMALL.replace(**change)
    model = lg.torch.Camera(camera, accuracy=accuracy)
    given = lg.Points(np.array(PLACES)[:, :3], np.array(PLACES)[:, 3])
    with torch.no_grad():
        found = model(given)[0].numpy()
    known = lg.simulate(camera, Scene([given]), lg.Incoherent(accuracy)).data
    assert np.linalg.norm(found - known) < 1e-6 * np.linalg.norm(known)  # simulate's are of single precision


@pytest.fixture(scope="module")
def fourteen():
    model = lg.torch.Camera(SMALL, KEYS, accuracy=3e-3)
    weighed(model(points())).backward()
    return model


@pytest.mark.parametrize("some", [range(7), range(7, 14)], ids=["main lens", "lenslets and pixels"])
def test_slopes_by_fourteen_keys_are_central_differences(fourteen, some):
    along = torch.zeros(14, dtype=torch.float64)
    along[list(some)] = torch.tensor([1.0, -0.5, 0.3, 1.0, -1.0, 0.7, 0.9], dtype=torch.float64)
    found = float((fourteen.parts.grad * along).sum())
    known = slope(lambda: weighed(fourteen(points())), fourteen.parts, along, 2e-3)
    assert found == pytest.approx(known, rel=SMOOTH)


def test_slopes_by_fifty_free_lenslets_are_central_differences():
    camera = SMALL.replace(lenslets={"count": (8, 8), "fill_factor": 1.0})
    keys = {f"lenslets.single.{n}.focal_change": "-0.05:0.05" for n in range(8, 58)}
    model = lg.torch.Camera(camera, keys, accuracy=1e-2)
    weighed(model(points())).backward()
    along = torch.as_tensor(np.random.default_rng(1).standard_normal(50))
    known = slope(lambda: weighed(model(points())), model.parts, along, 1e-3)
    assert float((model.parts.grad * along).sum()) == pytest.approx(known, rel=SMOOTH)
    assert int((model.parts.grad != 0).sum()) > 9  # as many as the points light


def test_slopes_reach_masks_places_and_light():
    rng = np.random.default_rng(3)
    mask = {
        "phase": (0.2 * rng.standard_normal((5, 5))).tolist(),
        "open": (0.3 + 0.4 * rng.random((5, 5))).tolist(),
    }
    camera = SMALL.replace(main_lens={"mask": mask})
    model = lg.torch.Camera(camera, ["main_lens.mask.phase", "main_lens.mask.open"])
    given = points(requires_grad=True)
    weighed(model(given)).backward()
    for name, size in (("phase", 1e-3), ("open", 1e-3)):
        along = torch.as_tensor(rng.standard_normal((5, 5)))
        known = slope(lambda: weighed(model(given)), model.mask[name], along, size)
        assert float((model.mask[name].grad * along).sum()) == pytest.approx(known, rel=SMOOTH)
    along = torch.tensor([[[1e-7, -2e-7, 4e-6, 0.1], [2e-7, 1e-7, 4e-6, -0.1]]], dtype=torch.float64)
    known = slope(lambda: weighed(model(given)), given, along, 1.0)
    assert float((given.grad * along).sum()) == pytest.approx(known, rel=SMOOTH)


@pytest.fixture(scope="module")
def scenes():
    camera, grid = SMALL.replace(lenslets={"count": (5, 5)}), lg.Grid.square(12, 60e-6)
    keys = {"lenslets.pitch": "148 um:153 um", "main_lens.focal_length": "59 mm:61 mm"}
    model = lg.torch.Camera(camera, keys, grid=grid, depths=[2e-3], accuracy=1e-2)
    x = torch.as_tensor(np.random.default_rng(2).random((2, 1, 12, 12))).requires_grad_()
    raw = model(x)
    weighed(raw).backward()
    return model, camera, grid, x, raw.detach().numpy()


def test_scenes_and_their_slopes_are_those_of_part_plane(scenes):
    model, camera, grid, x, raw = scenes
    ends = [
        tuple(camera.replace(lenslets={"pitch": f"{150 + side} um"}) for side in (-0.0005, 0.0005)),
        tuple(camera.replace(main_lens={"focal_length": f"{60 + side} mm"}) for side in (-0.0002, 0.0002)),
    ]
    plane, plain = camera.part_plane(ends, grid, 2e-3, accuracy=1e-2), x.detach().numpy()[:, 0]
    np.testing.assert_allclose(raw, plane.forward(plain), rtol=1e-6, atol=1e-9)
    by = np.random.default_rng(5).standard_normal(raw.shape)
    known = plane.gradient(plain, by) / (np.array([0.001, 0.0004]) / [5, 2])  # of a part of the range
    np.testing.assert_allclose(model.parts.grad.numpy(), known, rtol=1e-5)
    moved = x.grad.numpy()[:, 0]  # the adjoint: raw images are linear in scenes
    assert (moved * plain).sum() == pytest.approx((raw * by).sum(), rel=1e-8)


def test_scenes_without_lenslets_are_those_of_part_plane():
    camera = lg.load_camera("thesis-2f").replace(sensor={"shape": (40, 40)})
    grid, x = lg.Grid.square(10, 30e-6), np.random.default_rng(2).random((1, 1, 10, 10))
    model = lg.torch.Camera(camera, grid=grid, depths=[2e-3], accuracy=1e-2)
    with torch.no_grad():
        raw = model(torch.as_tensor(x))[0].numpy()
    known = camera.part_plane([], grid, 2e-3, accuracy=1e-2).forward(x[0, 0])
    np.testing.assert_allclose(raw, known, rtol=1e-6, atol=1e-9 * known.max())


def test_noise_is_drawn_by_a_seed_and_lets_slopes_through():
    camera = lg.load_camera("thesis-2f").replace(sensor={"shape": (20, 20)})
    model = lg.torch.Camera(camera, ["object_distance"], photons=1000.0, accuracy=1e-2)
    one, two = (model(points(), torch.Generator().manual_seed(7)) for _ in range(2))
    assert torch.equal(one, two)
    assert not torch.equal(one, model(points(), torch.Generator().manual_seed(8)))
    (one**2).sum().backward()
    assert model.parts.grad.item() != 0
    mean = model.eval()(points()).detach()
    drawn = torch.stack([model.exposure(mean / 1000.0) for _ in range(400)])
    deviation = (mean + camera.sensor.read_noise**2 + camera.sensor.gain**2 / 12).sqrt()
    assert float((drawn.std(0) / deviation).mean()) == pytest.approx(1, abs=0.01)


def test_parameters_stay_in_their_ranges_and_make_a_camera_file():
    model = lg.torch.Camera(SMALL, {"lenslets.focal_length": "5 mm:5.4 mm"})
    assert model.parts.tolist() == pytest.approx([0.5])
    with torch.no_grad():
        model.parts += 1
    assert model.values() == {"lenslets.focal_length": "5.4 mm"}
    assert model.camera.lenslets.focal_length == (5.4e-3,)
    assert "5.4 mm" in model.camera.to_toml()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"lenslets.focal_length": "5.3 mm:5.4 mm"}, "its range goes from 5.3 mm to 5.4 mm"),
        (["main_lens.aberrations.8"], "of which no range follows"),
        ({"main_lens.colour": "1:2"}, "main_lens.colour has no value in the camera file"),
        (["main_lens.mask.phase"], "has no control points in the camera file"),
    ],
)
def test_parameters_that_cannot_be_are_refused(parameters, words):
    with pytest.raises(lg.FormatError, match=words):
        lg.torch.Camera(SMALL, parameters)


def test_shapes_and_second_derivatives_are_refused_in_words(fourteen):
    with pytest.raises(lg.GeometryError, match=r"must be points \(batch, n, 4\)"):
        fourteen(torch.zeros(3, 3))
    with pytest.raises(lg.GeometryError, match="scenes have shape"):
        fourteen(torch.zeros(1, 2, 3, 3))
    film = lg.torch.Camera(lg.load_camera("thesis-2f").replace(sensor={"shape": (9, 9)}), ["object_distance"])
    (first,) = torch.autograd.grad((film(points()) ** 2).sum(), film.parts, create_graph=True)
    with pytest.raises(lg.GeometryError, match="second derivatives by keys"):
        first.sum().backward()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_a_model_on_a_gpu_is_the_same(fourteen):
    model = lg.torch.Camera(SMALL, KEYS, accuracy=3e-3).cuda()
    raw = model(points().cuda())
    weighed(raw.cpu()).backward()
    np.testing.assert_allclose(raw.detach().cpu(), fourteen(points()).detach(), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(model.parts.grad.cpu(), fourteen.parts.grad, rtol=1e-7)
