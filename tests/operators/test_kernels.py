"""The matrices of the lenslet-periodic operator: symmetries, light, factors, and what is kept."""

import math
from functools import partial

import numpy as np
import pytest

import cameras
from lumigraph.core.cache import Budget, ByteCache
from lumigraph.errors import SamplingError
from lumigraph.instruments import PlenopticCamera
from lumigraph.operators.lenslets import lenslet_light, point_images, point_subset
from lumigraph.operators.periodic import blocks, factors, kernels
from lumigraph.operators.periodic.border_correction import BorderCorrection
from lumigraph.operators.periodic.kernels import matrix
from lumigraph.operators.periodic.sizes import build_bytes
from lumigraph.operators.periodic.streamed import stream_bytes
from lumigraph.operators.sampling import border_classes
from lumigraph.operators.sampling.border_classes import BorderState
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sampling_rules import SamplingRules
from lumigraph.units import mm, nm, um

focused = partial(cameras.focused, pixel_pitch=9 * um, pitch=80 * um)


@pytest.fixture(scope="module")
def optics():
    return Optics.of(focused(), 122 * mm, 1e-2)


def block(part, offset):
    """The product of the factors at one offset (dy, dx)."""
    start = 0
    for dy, dx, rank in part.offsets:
        if (dy, dx) == offset:
            return part.left[:, start : start + rank] @ part.right[start : start + rank]
        start += rank
    return np.zeros((part.left.shape[0], part.right.shape[1]))


def whole(matrix):
    """All parts and the glare's pictures, as dense blocks by place."""
    return {
        (part.rows, part.columns, offset[:2]): block(part, offset[:2])
        for part in matrix.parts
        for offset in part.offsets
    }


def difference(one, other):
    """Of two results of `whole`, relative rms."""
    norm = math.sqrt(sum(np.linalg.norm(b) ** 2 for b in other.values()))
    none = np.zeros(next(iter(other.values())).shape)
    squares = [np.linalg.norm(one.get(k, none) - other.get(k, none)) ** 2 for k in one.keys() | other.keys()]
    return math.sqrt(sum(squares)) / norm


@pytest.mark.parametrize("layout", ["square", "hex"])
def test_mirrored_blocks_are_those_computed_one_by_one(layout, monkeypatch):
    """Folding left, right, up, down and across the diagonal changes nothing but rounding."""
    optics = Optics.of(focused(layout=layout, count=(3, 3)), 122 * mm, 1e-2).bricks
    monkeypatch.setattr(SamplingRules, "rank", 1e-5)
    monkeypatch.setattr(lenslet_light, "FAINTEST", 1e-2)
    monkeypatch.setattr(Optics, "lit", optics.lit + optics.array.lattice.pitch)
    monkeypatch.setattr(Optics, "reach", (2, 2))
    monkeypatch.setattr(Optics, "near", (1, 1))
    folded = whole(kernels._unpacked(kernels._build(optics), optics))
    monkeypatch.setattr(point_images.LensletPlaneWave, "even", (False, False))
    assert difference(folded, whole(kernels._unpacked(kernels._build(optics), optics))) < 1e-4


FAR = {"count": (2, 2), "layout": "hex", "offset": (10 * um, -15 * um)}
ARRAYS = {
    "all seen": (focused(), 1),
    "a larger sensor": (focused().replace(sensor={"pixel_pitch": 9 * um, "shape": (81, 81)}), 2),
    "hexagonal": (focused(**FAR), None),
    "three kinds": (focused(**FAR, focal_length=(5.2 * mm, 5 * mm, 5.4 * mm)), None),
}


def state_of(optics, row, column):
    """Of the lenslets around one cell of the image; and whether its row is an odd one."""
    cells, limits = optics.cells, []
    i, j = row - cells.ring[0], column - cells.ring[1]
    odd = i % 2 if cells.staggered else 0
    for k, place in enumerate((i + 0.5, j + 0.5 + odd / 2)):
        middle = cells.edge[k] + place * cells.size[k]
        half = optics.array.extent[k] / 2
        limits.append((-half - middle, half - middle))
    return BorderState(limits[0], limits[1], (cells.kind + j - odd) % cells.kinds), odd


@pytest.mark.parametrize("name", ARRAYS)
def test_borders_and_corners_add_up_to_what_the_lenslets_there_bring(name, monkeypatch):
    """Each cell's blocks, summed over the parts that it is in, against its own from its own lenslets alone.

    The arrays have few lenslets: all corners count. A larger sensor sees more cells beside the array.
    """
    monkeypatch.setattr(SamplingRules, "ring", 1.9)
    camera, ring = ARRAYS[name]
    optics = Optics.of(camera, 122 * mm, 1e-2).bricks
    if ring:
        assert optics.cells.ring[0] == ring
    monkeypatch.setattr(SamplingRules, "rank", 1e-5)
    for method in ("border", "corner"):
        monkeypatch.setattr(SamplingRules, method, lambda *_: 9.0)
    monkeypatch.setattr(Optics, "reach", (2, 2))
    monkeypatch.setattr(Optics, "near", (2, 2))
    parts = kernels._unpacked(kernels._build(optics), optics).parts
    builder = blocks.BlockBuilder(optics, print, 1)
    builder.periodic()
    last = optics.cells.image[0] - 1
    for row, column in ((0, 0), (0, 2), (1, 1), (1, 2), (2, 3), (last, 1)):
        state, odd = state_of(optics, row, column)
        known = builder.images([state], optics.reach)[state]
        for dy in (-1, 0, 2):
            direct = [known.line(dy)(dx) for dx in range(-1, 2)]
            for dx, expected in zip(range(-1, 2), direct, strict=True):
                offset = dy, dx + odd * dy % 2  # one on from odd rows to even ones
                found = sum(
                    block(part, offset) for part in parts if row in part.rows and column in part.columns
                )
                assert np.linalg.norm(found - expected) < 2e-4 * builder.norm**0.5


def wide():
    """A camera 1.0 of one lenslet, whose micro-image is three pitches wide."""
    return PlenopticCamera(
        wavelength=633 * nm,
        object_distance=240 * mm,
        main_lens={"focal_length": 120 * mm, "diameter": 8 * mm},
        lenslets={"pitch": 110 * um, "focal_length": 10 * mm, "count": (1, 1)},
        sensor={"pixel_pitch": 9 * um},
    )


@pytest.mark.parametrize("camera", [focused(count=(1, 1)), wide()], ids=["matched", "wide"])
def test_all_light_of_a_point_is_in_its_blocks_and_the_glare(camera):
    """Lenslets without gaps: the images of a point add up to 1, but for what the r⁻³ law has beyond.

    Behind a wide main lens micro-images overlap: light goes farther, and interferes more finely.
    """
    optics = Optics.of(camera, camera.object_distance, 1e-2)
    found = matrix(optics)
    periodic, samples = found.parts[0], math.prod(optics.cells.samples)
    near = sum(block(periodic, offset[:2]).sum(1) for offset in periodic.offsets)
    share = optics.image_scale**2 / samples * math.prod(optics.cells.points)
    np.testing.assert_allclose((near * share).mean(), 1, atol=0.05)
    assert (near * share).max() < 1.05


def test_what_makes_building_larger_is_told():
    """Lenslets with gaps leave more factors; behind an odd main lens no border mirrors another."""

    def needed(fill_factor=1.0, **main_lens):
        camera = focused(fill_factor=fill_factor).replace(
            lenslets={"count": (9, 9)}, main_lens={"focal_length": 60 * mm, **main_lens}
        )
        return build_bytes(Optics.of(camera, 122 * mm, 3e-3, camera.object_distance))

    faint = 1e-3  # it hardly blurs, and is odd all the same
    # As many factors are kept in the end: what mirrors nothing is held beside them until they are put.
    assert needed(aberrations={8: faint}) > 1.25 * needed(aberrations={11: faint})
    assert needed(fill_factor=0.4) > 1.8 * needed()


def test_few_factors_give_the_block_back(rng):
    """Thirty patterns of falling strength: those above the least, orthogonal, nothing of the others."""
    left, right = (np.linalg.qr(rng.standard_normal((n, 30)))[0] for n in (200, 90))
    strengths = 10.0 ** -np.arange(30)[:]
    dense = ((left * strengths) @ right.T).astype(np.float32)
    found_left, found_right, kept = factors.factors(dense, 3e-4)
    np.testing.assert_allclose(kept[::-1], [1, 0.1, 1e-2, 1e-3], rtol=1e-3)
    np.testing.assert_allclose(found_left.T @ found_left, np.eye(4), atol=1e-5)
    assert np.linalg.norm(found_left @ found_right - dense) < 1.1e-4


def test_points_are_chosen_whatever_their_number_and_wherever_their_light_stands(rng):
    """150 patterns of 200 points, all in a twentieth of the samples, as light at the edge of a cell."""
    block = np.zeros((200, 4000), np.float32)
    block[:, 100:300] = rng.standard_normal((200, 150)) @ rng.standard_normal((150, 200))
    found = point_subset.chosen(block, 1e-3)
    assert len(found.numbers) == 150
    assert np.linalg.norm(found.weights @ block[found.numbers] - block) < 1e-4 * np.linalg.norm(block)


@pytest.mark.parametrize(("least", "count"), [(5e-3, 3), (3e-6, 6)])
def test_products_are_as_precise_as_the_faintest_strength_needs(rng, least, count):
    """In single precision strengths of 1e-5 beside 1 would drown, and those of 1e-2 do not."""
    left, right = (np.linalg.qr(rng.standard_normal((n, 30)))[0] for n in (200, 90))
    dense = ((left * 10.0 ** -np.arange(30)[:]) @ right.T).astype(np.float32)
    products = factors._products(dense, least)
    assert products.dtype == (np.float32 if least > 1e-3 else np.float64)
    found_left, found_right, kept = factors.strongest(dense, None, least)
    np.testing.assert_allclose(kept[::-1], 10.0 ** -np.arange(count), rtol=2e-2)
    assert np.linalg.norm(found_left @ found_right - dense) < 1.2 * 10.0**-count


def test_factors_leave_out_hardly_more_than_the_fewest_that_there_are(rng):
    """Strengths that fall by a tenth from one to the next: what is left out, beside singular values."""
    left, right = (np.linalg.qr(rng.standard_normal((n, 90)))[0] for n in (90, 300))
    dense = ((left * 0.9 ** np.arange(90)) @ right.T).astype(np.float32)
    found_left, found_right, kept = factors.strongest(dense, None, 1.5e-2)
    fewest = np.linalg.svd(dense, compute_uv=False)[len(kept) :]
    assert len(kept) == 40
    np.testing.assert_allclose(found_left.T @ found_left, np.eye(len(kept)), atol=1e-5)
    assert np.linalg.norm(found_left @ found_right - dense) < 1.03 * np.linalg.norm(fewest)


@pytest.mark.parametrize("points", [60, 4])
def test_a_block_of_many_patterns_is_not_cut_short(rng, points):
    """Few points stand in a cell where the main lens is small."""
    dense = rng.standard_normal((points, 50)).astype(np.float32)
    left, right, _ = factors.factors(dense, 1e-3)
    np.testing.assert_allclose(left @ right, dense, atol=1e-4)


def test_a_faint_block_has_no_factors(rng):
    left, right, kept = factors.factors(rng.random((20, 10)), 100.0)
    assert (left.shape, right.shape, kept.shape) == ((20, 0), (0, 10), (0,))


def test_a_mirrored_factor_is_the_plane_turned_over(rng):
    factor = rng.random((12, 2))
    plane = factor.reshape(3, 4, 2)
    turned = point_images.mirrored(factor, (3, 4), True, False).reshape(3, 4, 2)
    np.testing.assert_array_equal(turned, plane[::-1])
    np.testing.assert_array_equal(
        point_images.mirrored(factor, (3, 4), False, True).reshape(3, 4, 2), plane[:, ::-1]
    )


def test_the_key_names_what_matters(optics):
    """Not the sensor; but every length, the accuracy and the array's border."""
    here = optics.key
    assert Optics.of(focused().replace(sensor={"pixel_pitch": 7 * um}), 122 * mm, 1e-2).key == here
    others = [
        focused(pitch=81 * um),
        focused(count=(4, 5)),
        focused(fill_factor=0.9),
        focused(magnification=0.4),
    ]
    keys = {Optics.of(camera, 122 * mm, 1e-2).key for camera in others}
    assert Optics.of(focused(rotation=0.1), 122 * mm, 1e-2).key == here
    keys |= {Optics.of(focused(), 121 * mm, 1e-2).key, Optics.of(focused(), 122 * mm, 5e-3).key, here}
    assert len(keys) == 7


def assert_equal(one, other):
    assert one.margin == other.margin
    for mine, theirs in zip(one.parts, other.parts, strict=True):
        assert (mine.rows, mine.columns, mine.offsets) == (theirs.rows, theirs.columns, theirs.offsets)
        np.testing.assert_array_equal(mine.left, theirs.left)
        np.testing.assert_array_equal(mine.right, theirs.right)
    for mine, theirs in zip(one.glare, other.glare, strict=True):
        np.testing.assert_array_equal(mine.spectra, theirs.spectra)
        np.testing.assert_array_equal(mine.pictures, theirs.pictures)


def test_what_is_kept_on_disk_comes_back_and_is_not_built_again(optics, tmp_path, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path))
    monkeypatch.setattr(kernels, "_MATRICES", ByteCache(Budget(limit=0)))
    built = matrix(optics)
    damaged = tmp_path / f"{optics.key}.kept.npz"
    with monkeypatch.context() as patch:
        patch.setattr(kernels, "_build", None)
        assert_equal(matrix(optics), built)
    for replaced in (b"", None):
        damaged.unlink()  # not written over: it is mapped
        if replaced is not None:
            damaged.write_bytes(replaced)
        assert_equal(matrix(optics), built)
        assert damaged.is_file()


def test_images_have_the_same_bits_whether_the_operator_was_built_or_found(tmp_path, monkeypatch):
    """They differed by 8e-8, so that a deconvolution that was killed and resumed differed by 1e-4."""
    monkeypatch.setattr(kernels, "_MATRICES", ByteCache(Budget(limit=0)))
    camera, images = focused(), []
    for folder in ("a", "a", "b", "off"):  # built, found, built again, built and not kept
        monkeypatch.setenv("LUMIGRAPH_CACHE", folder if folder == "off" else str(tmp_path / folder))
        operator = camera.operator(accuracy=1e-2)
        scene = np.random.default_rng(1).random(operator.shape[1]).astype(np.float32)
        raw = operator.forward(scene)
        images.append((raw, operator.adjoint(raw)))
    for raw, back in images[1:]:
        np.testing.assert_array_equal(raw, images[0][0])
        np.testing.assert_array_equal(back, images[0][1])


def test_the_points_chosen_of_a_block_give_the_others(rng):
    """Points between others in a smooth block: a few give all, but for what is told to be left out."""
    at = np.linspace(0, 1, 60)
    block = np.exp(-(((at[:, None] - rng.random(300)) / 0.3) ** 2)).astype(np.float32)
    found = point_subset.chosen(block, 1e-2)
    assert 4 < len(found.numbers) < 20
    assert np.linalg.norm(found.weights @ block[found.numbers] - block) < 5e-2
    turned = found.turned((6, 10), up=True, left=False)
    plane = block.reshape(6, 10, 300)[::-1].reshape(60, 300)
    np.testing.assert_allclose(plane[turned.numbers], block[found.numbers])
    np.testing.assert_allclose(turned.weights @ plane[turned.numbers], plane, atol=2e-2)


def test_factors_of_half_precision_give_the_block_back(rng):
    """Strong and faint patterns alike: products as they are would fall below what half precision holds."""
    left = rng.standard_normal((40, 6)).astype(np.float32)
    right = (
        rng.standard_normal((6, 500)).astype(np.float32) * np.logspace(0, -8, 6, dtype=np.float32)[:, None]
    )
    wide, narrow = factors.narrowed(left, right, np.float16)
    assert narrow.dtype == np.float16
    for k in range(6):
        found = np.outer(wide[:, k], narrow[k].astype(np.float32))
        assert np.linalg.norm(found - np.outer(left[:, k], right[k])) < 3e-4 * np.linalg.norm(found)


def test_light_of_a_far_lenslet_comes_by_way_of_few_numbers():
    """But for as little as is left out of it anyway; that of a near one comes as it is."""
    camera = cameras.focused(shape="round", pitch=200 * um, pixel_pitch=9 * um)
    builder = blocks.BlockBuilder(Optics.of(camera, 122 * mm, 1e-3), lambda _: None, 1)
    light, (focal_length,) = builder.apart, {builder.optics.array.focal_length}
    assert len(light.matrices(0.0, 0.0, focal_length)) == 1
    for pitches, most in ((2, 30), (4, 10)):
        at = 0.0, pitches * builder.optics.array.lattice.pitch, focal_length
        first, rest = light.matrices(*at)
        assert 0 < first.shape[1] < most
        left_out = np.linalg.norm(first @ rest - light._quadrature(*at), 2)
        assert left_out < 1.2 * light.faintest * np.linalg.norm(light._quadrature(0.0, 0.0, focal_length), 2)


@pytest.mark.parametrize("layout", ["hex", "round"])
def test_lenslets_between_limits_are_sums_from_one_side_less_others(layout):
    """Amplitudes of all states at once are those of each state's own lenslets."""
    shape = {"layout": "hex"} if layout == "hex" else {"shape": "round"}
    optics = Optics.of(focused(count=(3, 3), **shape), 122 * mm, 1e-2).bricks
    builder = blocks.BlockBuilder(optics, lambda _: None, 1)
    points = point_subset.ChosenPoints(
        np.array([0, 5]), np.ones((math.prod(optics.cells.points), 2), np.float32)
    )
    states = {place.state for place in border_classes.places(optics)}
    assert any(math.inf not in (abs(state.x[0]), state.x[1]) for state in states)
    missing = BorderCorrection(builder.lenslets, builder.apart, optics.cells, {(0, 1): points}, states, 1)
    found, middle = missing.images([(0, 1)]), optics.cells.middle(0)
    for state in states:
        rows = list(builder.lenslets.rows(middle, (state.y, state.x)))
        field = builder.apart.amplitudes(missing._numbers((0, 1)), rows)
        np.testing.assert_allclose(found[state], np.abs(field) ** 2, atol=1e-5 * np.abs(field).max() ** 2)


def test_the_memory_that_is_free_does_not_choose_between_held_and_streamed(optics, monkeypatch):
    """Images differ by a sixth of what is asked: a worker must not stream what the first one held."""
    assert stream_bytes(optics) < build_bytes(optics)
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: build_bytes(optics) - 1)
    monkeypatch.setattr(kernels, "_MATRICES", ByteCache())
    monkeypatch.setenv("LUMIGRAPH_CACHE", "off")
    with pytest.raises(
        SamplingError, match=r"the periodic operator needs \S+ GiB but \S+ GiB are free\. Use"
    ):
        matrix(optics)
