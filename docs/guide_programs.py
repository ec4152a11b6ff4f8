"""Pictures of guides that short programs make, in docs/_static/guides.

Run: python docs/guide_programs.py [NAME ...], with names of the functions in `PICTURES`: some minutes.
"""

import io
import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from guide_reports import keep

import lumigraph as lg
from lumigraph.deconvolution import Exposure, RichardsonLucy
from lumigraph.units import mm, um


def save(figure: plt.Figure, name: str) -> None:
    """Write a figure with a palette."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=100, bbox_inches="tight", pad_inches=0.05)
    plt.close(figure)
    keep(buffer.getvalue(), name)


def row(
    pictures: Sequence[tuple[np.ndarray, str]], name: str, height: float = 2.2, **options: object
) -> None:
    """Pictures side by side with their titles."""
    widths = [image.shape[1] / image.shape[0] for image, _ in pictures]
    size = (height * sum(widths) + 0.1, height + 0.3)
    figure, axes = plt.subplots(1, len(pictures), figsize=size, width_ratios=widths, layout="constrained")
    for where, (image, title) in zip(np.atleast_1d(axes), pictures, strict=True):
        where.imshow(image, **({"cmap": "gray", "interpolation": "nearest"} | options))
        where.set_title(title, fontsize=9)
        where.set_axis_off()
    save(figure, name)


def changes(pictures: Sequence[tuple[np.ndarray, str]], name: str) -> None:
    """Pictures side by side in red above 0 and blue below, each to its own largest value."""
    scaled = [(image / np.abs(image).max(), title) for image, title in pictures]
    row(scaled, name, cmap="RdBu_r", vmin=-1, vmax=1)


def middle(image: np.ndarray, size: int) -> np.ndarray:
    """Square around the middle of a picture."""
    y, x = (n // 2 - size // 2 for n in image.shape[:2])
    return image[y : y + size, x : x + size]


def root(image: object) -> np.ndarray:
    """Square root of light, 0 to 1, so that faint light shows."""
    data = np.maximum(np.asarray(getattr(image, "data", image), float), 0)
    return np.sqrt(data / data.max())


def point_of(camera: lg.FocusedPlenopticCamera, dz: float = 0.0) -> np.ndarray:
    """Raw image of a point near the axis."""
    point = lg.targets.points([(20 * um, -30 * um, dz)])
    return np.asarray(lg.simulate(camera, point, lg.Incoherent(1e-2)).data, float)


def single() -> None:
    """White images and images of a point: lenslets alike, and one that is stronger and aside."""
    plain = lg.load_camera("thesis-plenoptic-2-m050").replace(
        main_lens={"diameter": "3 mm"}, lenslets={"count": (9, 9), "fill_factor": 0.9}, sensor={"shape": None}
    )
    own = {41: {"focal_change": 0.3}, 32: {"offset_y": "5 um"}}
    changed = plain.replace(lenslets={"single": own})
    pictures = [
        (root(point_of(one, 3 * mm)), what)
        for one, what in ((plain, "all alike"), (changed, "41 stronger, 32 aside"))
    ]
    size = 260
    row([(middle(image, size), title) for image, title in pictures], "single-point")
    changes([(middle(pictures[1][0] - pictures[0][0], size), "what changes")], "single-change")


def built() -> None:
    """White images of an array as described, and as built: it leans."""
    camera = lg.load_camera("thesis-plenoptic-1").replace(
        lenslets={"count": (15, 15)}, sensor={"pixel_pitch": "8 um", "shape": None}
    )
    leaning = camera.replace(built={"array_tilt": ["40 mrad", "0 mrad"]})
    light = lg.Incoherent(1e-2)
    whites = [
        np.asarray(lg.simulate(one, lg.targets.white(), light).data, float) for one in (camera, leaning)
    ]
    row([(whites[0], "white image, as described"), (whites[1], "array tilted by 40 mrad")], "built-white")
    changes([(whites[1] - whites[0], "difference")], "built-change")


def derivatives() -> None:
    """A point's image, and how it changes with a focal length, a distance and the pitch."""
    camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
        main_lens={"diameter": "3 mm"}, lenslets={"count": (9, 9)}, sensor={"shape": (361, 361)}
    )
    keys = {
        "focal length of the lenslets": [
            {"lenslets": {"focal_length": f}} for f in ("5.1999 mm", "5.2001 mm")
        ],
        "object distance": [{"object_distance": z} for z in ("119.999 mm", "120.001 mm")],
        "pitch": [{"lenslets": {"pitch": p}} for p in ("149.99 um", "150.01 um")],
    }
    images = camera.part_images([tuple(camera.replace(**end) for end in pair) for pair in keys.values()])
    points = lg.Points(np.array([[2e-5, -4e-5, 4e-3]]), np.array([1.0]))
    row([(root(images.forward(points)), "image of a point, square root")], "derivatives-point")
    parts = [np.asarray(images.derivative(points, np.eye(3)[k])) for k in range(3)]
    changes(list(zip(parts, keys, strict=True)), "derivatives-keys")


def exact() -> None:
    """A point through fast lenslets: paraxial, exact, and their difference."""
    fast = lg.PlenopticCamera(
        wavelength="550 nm",
        object_distance="40 mm",
        main_lens={"focal_length": "20 mm"},
        lenslets={"pitch": "40 um", "focal_length": "160 um", "count": (5, 5)},
        sensor={"pixel_pitch": "0.5 um"},
    )
    found = [
        np.asarray(
            lg.simulate(
                fast.replace(model=m), lg.targets.points([(3 * um, 5 * um, 2 * mm)]), lg.Incoherent(1e-2)
            ).data,
            float,
        )
        for m in ("paraxial", "exact")
    ]
    shown = [middle(one, 60) for one in found]
    row([(root(shown[0]), "paraxial lenslets, f/4"), (root(shown[1]), "exact")], "exact-point")
    changes([(shown[1] - shown[0], "exact less paraxial")], "exact-change")


def operator() -> None:
    """What the operator makes of an object, and its transpose of a raw image."""
    camera = lg.FocusedPlenopticCamera(
        wavelength=633e-9,
        object_distance=0.12,
        main_lens={"focal_length": 0.06},
        lenslets={"pitch": 100e-6, "focal_length": 5.2e-3, "count": (9, 9), "magnification": 0.5},
        sensor={"pixel_pitch": 4e-6},
    )
    linear = camera.operator(samples_per_lenslet=5, accuracy=1e-2)
    star = np.asarray(lg.targets.siemens_star(linear.object_grid, 8).parts[0].intensity, np.float32)
    raw = np.asarray(linear.forward(star))
    back = np.asarray(linear.adjoint(raw))
    row([(star, "object o"), (raw, "raw image A o"), (back, "transpose Aᵀ A o")], "operator-star")
    place = np.zeros_like(star)
    place[star.shape[0] // 2 + 3, star.shape[1] // 2 + 4] = 1
    spot = np.asarray(linear.forward(place))
    row([(place, "one sample"), (root(spot), "its raw image: a column of A")], "operator-column")


def information() -> None:
    """How a point's image changes with its place and depth, before a Fourier microscope of 3 x 3 lenslets."""
    scope = lg.load_camera("lfm-fourier")
    step, at = 0.3 * um, np.array([1 * um, -2 * um, 18 * um])  # y, x, depth
    image, lower, deeper = (
        np.asarray(scope.point_image(*(at + move), accuracy=1e-2))
        for move in ((0, 0, 0), (step, 0, 0), (0, 0, step))
    )
    peaks = _peaks(image)
    row([(root(_around(image, peaks)), "image of a point: nine spots")], "information-point")
    parts = [(lower - image, "change with y"), (deeper - image, "change with depth")]
    changes([(_around(one, peaks), title) for one, title in parts], "information-changes")


def _peaks(image: np.ndarray) -> list[list[tuple[int, int]]]:
    """Brightest pixels behind each of 3 x 3 lenslets."""
    thirds = [np.array_split(np.arange(n), 3) for n in image.shape]
    found = []
    for rows in thirds[0]:
        parts = [image[np.ix_(rows, columns)] for columns in thirds[1]]
        places = [np.unravel_index(part.argmax(), part.shape) for part in parts]
        found.append([(rows[y], columns[x]) for (y, x), columns in zip(places, thirds[1], strict=True)])
    return found


def _around(image: np.ndarray, peaks: list[list[tuple[int, int]]], half: int = 14) -> np.ndarray:
    """Surroundings of places, side by side."""
    return np.block([[image[y - half : y + half, x - half : x + half] for y, x in line] for line in peaks])


def hiding() -> None:
    """A chart behind a card: seen through the card, and hidden by it."""
    camera = lg.PlenopticCamera(
        wavelength="550 nm",
        object_distance="120 mm",
        main_lens={"focal_length": "60 mm"},
        lenslets={"pitch": "125 um", "focal_length": "5 mm", "count": (15, 15)},
        sensor={"pixel_pitch": "8 um"},
    )
    grid = lg.Grid.square(60, 15 * 0.125 * mm / 60)
    chart = lg.targets.siemens_star(grid, 8).parts[0].intensity
    cover = ((grid.x[None, :] > 0.1 * mm) & (np.abs(grid.y)[:, None] < 0.5 * mm)).astype(float)
    far = lg.Slice(chart, grid, dz=10 * mm)
    pictures = []
    for opaque, title in ((None, "light adds up"), (cover, "the card hides the chart")):
        near = lg.Slice(0.4 * cover, grid, dz=-5 * mm, opacity=opaque)
        raw = lg.simulate(camera, lg.Scene([far, near]), lg.Incoherent(1e-2))
        pictures.append((np.asarray(raw.data, float), title))
    row(pictures, "hiding")


def spectra() -> None:
    """A white image with pixels that see all angles alike, and with pixels that do not."""
    camera = lg.load_camera("thesis-plenoptic-1").replace(
        lenslets={"count": (9, 9)}, sensor={"pixel_pitch": "4 um", "shape": None}
    )
    seen = camera.replace(
        sensor={
            "fill_factor": 0.8,
            "angular_response": {
                "angles": ["0 deg", "0.5 deg", "1 deg", "2 deg"],
                "values": [1.0, 0.9, 0.65, 0.3],
            },
        }
    )
    light = lg.Incoherent(1e-2)
    whites = [np.asarray(lg.simulate(one, lg.targets.white(), light).data, float) for one in (camera, seen)]
    top = max(one.max() for one in whites)
    titles = ("even pixels", "80 % filled, fewer counts aslant")
    row(
        [(one / top, title) for one, title in zip(whites, titles, strict=True)],
        "spectra-pixels",
        vmin=0,
        vmax=1,
    )


def plan() -> None:
    """How well lengths are known after each picture of a board."""
    camera = lg.load_camera("multi-focus-hex")
    metric, target = (
        lg.metrology.MetricCamera.of(camera),
        lg.metrology.Board.from_text("8 x 5 corners, 0.4 mm"),
    )
    nominal = lg.metrology.Nominal(
        camera.main_lens.focal_length, camera.sensor.pixel_pitch, camera.sensor.shape
    )
    found = lg.metrology.plan(metric, camera.calibration, target, nominal, pictures=12)
    numbers = np.arange(1, len(found.steps) + 1)
    known = {name: 100 * found.known[1:, k] for k, name in enumerate(("f", "L", "b", "distances"))}
    figure = lg.plots.curves(numbers[1:], known, xlabel="pictures", ylabel="95 % interval [± %]")
    figure.axes[0].set_yscale("log")
    save(figure, "board-plan")


def board() -> None:
    """Raw image and rendered picture of a board before a camera 2.0."""
    camera = lg.load_camera("multi-focus-hex")
    grid = camera.object_grid
    y, x = np.meshgrid(grid.y, grid.x, indexing="ij")
    turn = np.deg2rad(7)
    squares = np.floor((np.cos(turn) * y + np.sin(turn) * x) / (0.4 * mm)) + np.floor(
        (np.cos(turn) * x - np.sin(turn) * y) / (0.4 * mm)
    )
    scene = lg.Scene([lg.Slice(0.1 + 0.9 * (squares % 2), grid)])
    raw = lg.simulate(camera, scene, lg.Incoherent(1e-2))
    picture = np.asarray(lg.render(raw, camera.calibration, patch=camera.patch), float)
    part = middle(np.asarray(raw.data, float), 400)
    row(
        [(part / part.max(), "raw image of a board (the middle)"), (picture / picture.max(), "rendered")],
        "board-raw",
    )


def adaptive() -> None:
    """Aberrations from a raw image of a bead: the program of the page."""
    from lumigraph.studies.adaptive import wavefront_map

    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        wavelength="525 nm",
        objective={"magnification": 20.0, "numerical_aperture": 0.5, "immersion_index": 1.0},
        lenslets={"pitch": "125 um", "count": (7, 7)},
        sensor={"shape": (135, 135)},
    )
    true = {6: 0.15, 8: -0.1}
    bent = scope.replace(objective={"aberrations": true})
    images = [
        1000 * np.asarray(one.point_image(-8e-6, -7e-6, 7.7e-6, accuracy=3e-2)) for one in (scope, bent)
    ]
    raw = np.random.default_rng(2).poisson(images[1] + 1).astype(np.float32)
    found = lg.adaptive.estimate(
        raw,
        scope,
        depths=(2e-6, 8e-6, 14e-6),
        terms=(5, 6, 7, 8),
        exposure=Exposure(background=1.0, gain=1.0),
    )
    row([(root(images[0]), "a bead, no aberration"), (root(raw), "raw image, aberrated")], "adaptive-raw")
    maps = [(wavefront_map(true), "true wavefront"), (found.phase(), "found")]
    changes([(np.nan_to_num(one), title) for one, title in maps], "adaptive-wavefront")


def scene() -> None:
    """A texture before an aberrated camera: its wavefront, and deconvolutions without and with it."""
    from scipy.ndimage import gaussian_filter

    from lumigraph.studies.adaptive import wavefront_map

    camera = lg.PlenopticCamera(
        wavelength="600 nm",
        object_distance="400 mm",
        main_lens={"focal_length": "200 mm"},
        lenslets={"pitch": "60 um", "count": (9, 9), "focal_length": "1.25 mm"},
        sensor={"pixel_pitch": "5 um"},
    )
    true, rng = {5: 0.12, 6: -0.15, 7: 0.1, 8: 0.06}, np.random.default_rng(0)
    linear = camera.replace(main_lens={"aberrations": true}).operator((0.0,), 9, accuracy=5e-3)
    texture = gaussian_filter(rng.normal(size=linear.shape[1]), (0, 5, 5))
    texture = np.maximum(texture / texture.std() + 0.7, 0.02).astype(np.float32)
    light = np.maximum(np.asarray(linear.forward(texture)), 0)
    raw = rng.poisson(300 * light / light.mean() + 0.01).astype(np.float32)
    known = Exposure(background=0.01, gain=1.0)
    found = lg.adaptive.estimate(raw, camera, (0.0,), terms=tuple(true), object="picture", exposure=known)
    pictures = [(texture[0], "texture")]
    for one, title in ((camera, "as if there were none"), (found.instrument, "through what was found")):
        picture = lg.deconvolve(raw, one.operator((0.0,), 9, accuracy=5e-3), 40, exposure=known)
        pictures.append((np.asarray(picture)[0], title))
    row([(np.minimum(one / one.mean(), 3), title) for one, title in pictures], "adaptive-scene")
    maps = [(wavefront_map(true), "true wavefront"), (found.phase(), "found")]
    changes([(np.nan_to_num(one), title) for one, title in maps], "adaptive-scene-wavefront")


def datasets() -> None:
    """Samples of a data set: raw images, pictures and depths."""
    import tempfile

    import zarr

    from lumigraph.cli import main as lumigraph

    with tempfile.TemporaryDirectory() as folder:
        camera = lg.load_camera("thesis-plenoptic-1").replace(
            lenslets={"count": (21, 21)}, sensor={"pixel_pitch": "8 um", "shape": None}
        )
        path = Path(folder) / "camera.toml"
        path.write_text(camera.to_toml())
        store = Path(folder) / "train.zarr"
        if lumigraph(["dataset", str(path), "-n", "3", "--depth", "-60 mm:60 mm:40 mm", "-o", str(store)]):
            raise SystemExit("no data set")
        data = zarr.open_group(store, mode="r")
        raws, pictures, depths = (np.asarray(data[name], float) for name in ("raw", "picture", "depth"))
    row([(middle(one / one.max(), 180), f"raw {k}") for k, one in enumerate(raws)], "datasets-raw", 1.8)
    figure, axes = plt.subplots(1, 6, figsize=(10, 1.9), layout="constrained")
    for k, where in enumerate(axes):
        shown = (pictures, depths)[k // 3][k % 3]
        where.imshow(shown, cmap="gray" if k < 3 else "viridis")
        where.set_title(f"{'picture' if k < 3 else 'depth'} {k % 3}", fontsize=9)
        where.set_axis_off()
    save(figure, "datasets-truth")


def twin() -> None:
    """Offsets of micro-images on a bench whose array is turned, shifted and too high."""
    camera = lg.load_camera("thesis-plenoptic-1").replace(
        lenslets={"count": (15, 15)}, sensor={"pixel_pitch": "8 um", "shape": None}
    )
    shape = lg.simulate(camera, lg.targets.white(), lg.Incoherent(1e-2)).data.shape
    bench = camera.replace(
        sensor={"shape": shape},
        lenslets={"rotation": "12 mrad", "offset": ["20 um", "0 um"]},
        built={"lenslet_distance": 1.02 * camera.lenslet_distance},
    )
    white = np.asarray(lg.simulate(bench, lg.targets.white(), lg.Incoherent(1e-2)).data, float)
    meant, found = (one.calibration.lattice.centers((0, shape[0]), (0, shape[1])) for one in (camera, bench))
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.2), layout="constrained")
    axes[0].imshow(white, cmap="gray")
    axes[0].set_title("white image of the bench", fontsize=9)
    moved = found - meant
    axes[1].quiver(
        meant[:, 1], meant[:, 0], moved[:, 1], moved[:, 0], angles="xy", scale_units="xy", scale=0.25
    )
    axes[1].invert_yaxis()
    axes[1].set_aspect("equal")
    axes[1].set_title("micro-images from where the file puts them, x 4", fontsize=9)
    for where in axes:
        where.set_axis_off()
    save(figure, "twin")


def frames() -> None:
    """Three frames of a film of drifting beads, and the volume of each."""
    from lumigraph.deconvolution import filters

    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        wavelength="525 nm",
        objective={"magnification": 20.0, "numerical_aperture": 0.5, "immersion_index": 1.0},
        lenslets={"pitch": "125 um", "count": (11, 11)},
        sensor={"shape": (211, 211)},
    )
    depths = np.arange(-24e-6, 25e-6, 12e-6)
    linear = scope.operator(depths, 3, accuracy=1e-2)
    widths = filters.widths_of(scope.low_pass_distances(depths), linear.object_grid.pitch[0])
    rng, raws, tops = np.random.default_rng(3), [], []
    places = np.column_stack([rng.integers(0, 5, 9), rng.integers(6, 27, (9, 2))])
    for frame in range(3):
        beads = np.zeros(linear.shape[1], np.float32)
        beads[places[:, 0], places[:, 1], places[:, 2] + 2 * frame - 2] = 5000
        raws.append(rng.poisson(np.maximum(linear.forward(beads), 0) + 1).astype(np.float32))
        volume = lg.deconvolve(raws[-1], linear, 20, method=RichardsonLucy(filter=filters.LowPass(widths)))
        tops.append(np.asarray(volume).max(0))
    row([(root(one), f"raw image, frame {k}") for k, one in enumerate(raws)], "frames-raw", 2.0)
    row(
        [(root(one), f"volume from above, frame {k}") for k, one in enumerate(tops)],
        "frames-volume",
        2.0,
        cmap="magma",
    )


def masks() -> None:
    """A point out of focus through a clear stop, a coded aperture and a diffuser; phase of the diffuser."""
    rough = 0.5 * np.random.default_rng(0).standard_normal((8, 8))
    rng = np.random.default_rng(5)
    code = (rng.random((7, 7)) > 0.45).astype(float)
    plain = lg.load_camera("thesis-2f").replace(sensor={"shape": (96, 96)}, main_lens={"diameter": "4 mm"})
    kinds = {
        "clear stop": None,
        "coded aperture": {"open": code.tolist()},
        "diffuser": {"phase": rough.tolist()},
    }
    pictures = []
    for title, mask in kinds.items():
        camera = plain if mask is None else plain.replace(main_lens={"mask": mask})
        raw = lg.simulate(camera, lg.targets.points([(0, 0, 14 * mm)]), lg.Incoherent(1e-2))
        pictures.append((root(raw), title))
    row(pictures, "masks-point")
    row([(code, "coded aperture, open"), (rough, "diffuser, phase")], "masks")


def errors() -> None:
    """What the command line says of damaged files, as a terminal shows it."""
    import contextlib
    import os
    import tempfile

    from lumigraph.cli import main as lumigraph

    lines = []
    with tempfile.TemporaryDirectory() as folder:
        start = Path.cwd()
        os.chdir(folder)
        lg.save(np.random.default_rng(0).random((64, 64)), "raw.png")
        lg.save(np.random.default_rng(0).random((64, 64)), "raw.tiff")
        whole = Path("raw.png").read_bytes()
        Path("cut.png").write_bytes(whole[: len(whole) // 2])
        Path("changed.png").write_bytes(whole[:900] + bytes([whole[900] ^ 4]) + whole[901:])
        Path("cut.tiff").write_bytes(Path("raw.tiff").read_bytes()[:3000])
        for name in ("cut.png", "changed.png", "cut.tiff"):
            text = io.StringIO()
            with contextlib.redirect_stderr(text), contextlib.redirect_stdout(text):
                lumigraph(["calibrate", name, "-o", "calibration.toml"])
            lines += [f"$ lumigraph calibrate {name} -o calibration.toml", text.getvalue().strip(), ""]
        os.chdir(start)
    terminal(lines, "trusted-errors")


def terminal(lines: Sequence[str], name: str) -> None:
    """Lines as a terminal shows them, wrapped at 92 characters."""
    import textwrap

    wrapped = [part for line in lines for part in (textwrap.wrap(line, 92) or [""])]
    figure = plt.figure(figsize=(7.6, 0.19 * len(wrapped) + 0.2), facecolor="#14181d")
    figure.text(
        0.01, 0.98, "\n".join(wrapped).rstrip(), color="#e6e6e6", family="monospace", size=9, va="top"
    )
    save(figure, name)


def writing() -> None:
    """A file before, while and after it is written: a killed writer leaves the old one or the new one."""
    steps = [
        ("before", ["volume.zarr  old"]),
        ("while it is written", ["volume.zarr  old", ".lumigraph-3f  new, not whole"]),
        ("in one step", ["volume.zarr  new"]),
        ("killed while writing", ["volume.zarr  old", ".lumigraph-3f  removed next time"]),
    ]
    figure, axes = plt.subplots(1, 4, figsize=(9, 1.5), layout="constrained")
    for where, (title, files) in zip(axes, steps, strict=True):
        where.set_title(title, fontsize=9)
        for k, text in enumerate(files):
            colour = (
                "#1b7f4b"
                if "new" in text and "not" not in text
                else "#35618f"
                if "old" in text
                else "#a05a00"
            )
            where.text(
                0.5,
                0.72 - 0.42 * k,
                text,
                ha="center",
                va="center",
                fontsize=8.5,
                color="white",
                bbox={"boxstyle": "round,pad=0.5", "color": colour},
            )
        where.set_axis_off()
    save(figure, "trusted-writing")


PICTURES = (
    single,
    built,
    derivatives,
    exact,
    operator,
    information,
    hiding,
    spectra,
    plan,
    board,
    adaptive,
    scene,
    datasets,
    twin,
    frames,
    masks,
    errors,
    writing,
)


if __name__ == "__main__":
    for picture in PICTURES:
        if len(sys.argv) == 1 or picture.__name__ in sys.argv[1:]:
            print(picture.__name__, flush=True)
            picture()
