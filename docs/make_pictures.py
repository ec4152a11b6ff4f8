"""The pictures of README and of the tutorials, in docs/_static.

Run: python docs/make_pictures.py [NAME ...], with names of the functions in `PICTURES`. Screenshots need
playwright and Chromium (`tests/viewer/conftest.py` finds the same one).
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import lumigraph as lg

STATIC = Path(__file__).parent / "_static"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SYSTEM = Path("/usr/bin/chromium")


def save(figure: plt.Figure, name: str) -> None:
    """Write a figure as PNG, 110 dpi."""
    figure.savefig(STATIC / name, dpi=110, bbox_inches="tight", pad_inches=0.05)
    plt.close(figure)


def shown(picture: object) -> np.ndarray:
    """Picture (y, x[, 3]) as a screen shows it, from 0 to 1."""
    return np.clip(np.asarray(picture), 0, 1) ** (1 / 2.2)


def row(pictures: list[tuple[np.ndarray, str]], name: str, height: float = 2.6) -> None:
    """Pictures side by side with their titles."""
    widths = [image.shape[1] / image.shape[0] for image, _ in pictures]
    size = (height * sum(widths) + 0.1, height + 0.3)
    figure, axes = plt.subplots(1, len(pictures), figsize=size, width_ratios=widths, layout="constrained")
    for where, (image, title) in zip(axes, pictures, strict=True):
        where.imshow(image, cmap="gray", interpolation="nearest")
        where.set_title(title, fontsize=9)
        where.set_axis_off()
    save(figure, name)


def first() -> None:
    """A raw image of 9 x 9 pixels to a lenslet, two refocused pictures and depth: first.png."""
    sample = lg.samples.scene()
    views = sample.views
    data = np.asarray(views.data)
    v, u, t, s, colours = data.shape
    y, x = np.ogrid[:v, :u]
    stop = np.hypot(y - v // 2, x - u // 2) < v / 2  # round, as a camera's
    raw = (data * stop[:, :, None, None, None]).transpose(2, 0, 3, 1, 4).reshape(t * v, s * u, colours)
    step = views.lenslets.pitch[1] / views.aperture.pitch[1]
    near, far = (lg.refocus(views, 1 - d * step) for d in (1.9, -1.5))
    depth = np.asarray(lg.depth.epi(views).values)
    depth = plt.get_cmap("viridis")((depth - np.nanmin(depth)) / np.ptp(depth[np.isfinite(depth)]))[..., :3]
    part = raw[62 * v : 86 * v, 112 * u : 144 * u]
    pictures = [(shown(part), "raw image (a part), 9 x 9 pixels a lenslet")]
    pictures += [(shown(near), "focus near"), (shown(far), "focus far"), (depth, "disparity")]
    row(pictures, "first.png", 2.2)


def bench() -> None:
    """White, raw and refocused pictures of a simulated 1.0 camera: bench.png, bench-refocused.png."""
    sample = lg.samples.bench()
    calibration = lg.calibrate(sample.white)
    raw, white = (np.asarray(image.data, float) for image in (sample.raw, sample.white))
    top, left = raw.shape[0] // 2 - 60, raw.shape[1] // 2 - 90
    part = slice(top, top + 120), slice(left, left + 180)
    row(
        [(white[part] / white.max(), "white image (a part)"), (raw[part] / raw.max(), "raw image (a part)"),
         (raw / raw.max(), "raw image")],
        "bench.png", 2.2,
    )  # fmt: skip
    views = lg.decode(lg.devignette(sample.raw, sample.white), calibration)
    pictures = []
    for alpha, title in (
        (0.9, "α' = 0.9: the star in front"),
        (1.0, "1.0: the chart"),
        (1.1, "1.1: the star behind"),
    ):
        picture = np.asarray(lg.refocus(views, alpha, oversample=4), float)
        pictures.append((picture / np.nanmax(picture), title))
    row(pictures, "bench-refocused.png", 1.6)


def calibration() -> None:
    """The lattice on the white image of a simulated 1.0 camera: calibrate-lattice.png."""
    sample = lg.samples.bench()
    save(lg.plots.lattice(sample.white, lg.calibrate(sample.white)), "calibrate-lattice.png")


def microscope() -> None:
    """Raw image and volume of a light-field microscope: microscope-raw.png, microscope-volume.png."""
    from lumigraph.deconvolution import RichardsonLucy, filters

    sample = lg.samples.volume()
    depths = sample.volume.depths
    operator = sample.camera.operator(depths, sample.samples_per_lenslet, accuracy=1e-2)
    widths = filters.widths_of(sample.camera.low_pass_distances(depths), operator.object_grid.pitch[0])
    found = lg.deconvolve(sample.raw, operator, 20, method=RichardsonLucy(filter=filters.LowPass(widths)))
    raw = np.asarray(sample.raw.data, float)
    figure, axes = plt.subplots(figsize=(3.2, 3.2), layout="constrained")
    axes.imshow(raw, cmap="gray")
    axes.set_axis_off()
    save(figure, "microscope-raw.png")
    save(lg.plots.projections(found), "microscope-volume.png")


def design() -> None:
    """Rays of a 2.0 camera, its raw image and its rendered picture: design-rays.png, design-picture.png."""
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    save(lg.plots.layout(camera), "design-rays.png")
    raw = lg.simulate(camera, lg.targets.usaf1951(camera.object_grid))
    picture = np.asarray(lg.render(raw, camera.calibration, patch=camera.patch), float)
    data = np.asarray(raw.data, float)
    middle = slice(data.shape[0] // 2 - 500, data.shape[0] // 2 + 500)
    part = data[middle, middle][::2, ::2]
    row([(part / part.max(), "raw image (the middle)"), (picture / picture.max(), "rendered picture")],
        "design-picture.png")  # fmt: skip


def viewer() -> None:
    """The viewer with the sample scene: viewer.png."""
    with tempfile.TemporaryDirectory() as folder:
        lg.samples.write(Path(folder), ("scene",))
        screenshot(["view", f"{folder}/scene.zarr"], "viewer.png")


STATES = {
    "viewer-tilt.png": "#focus=1.1807&tilt=-0.588,0",
    "viewer-sharp.png": "#sharpen=1.2",
    "viewer-depth.png": "#mode=depth&map=viridis",
}
"""Links of the viewer: the floor in focus from front to back, what is in focus sharpened, depth."""


def states() -> None:
    """The viewer with the sample scene in several states: `STATES`; a volume in 3-D: viewer-volume.png."""
    with tempfile.TemporaryDirectory() as folder:
        lg.samples.write(Path(folder), ("scene", "volume"))
        for name, link in STATES.items():
            screenshot(["view", f"{folder}/scene.zarr"], name, link)
        volume = ["view", f"{folder}/volume-truth.ome.tif"]
        screenshot(volume, "viewer-volume.png", "#mode=volume&projection=fog")


def designer() -> None:
    """The designer with a camera of the catalogue: designer.png."""
    screenshot(["design", "thesis-plenoptic-2-m050", "--web"], "designer.png")


def laboratory() -> None:
    """White, raw and rendered images of the thesis' bench, a part of its array: laboratory-*.png."""
    whole = lg.load_camera("thesis-prototype")
    meant = whole.replace(lenslets={"count": (17, 13)}, sensor={"pixel_pitch": "3.34 um", "shape": None})
    shape, light = meant.sensor.shape, lg.Incoherent(1e-2)
    turned = meant.replace(lenslets={"rotation": "1.5 deg"}, sensor={"shape": shape})
    closed = meant.replace(main_lens={"diameter": 0.7 * meant.pupil_diameter})
    whites = [(turned, "turned by 1.5°"), (closed, "aperture too small"), (meant, "as meant: they touch")]
    row([(_bright(lg.simulate(each, lg.targets.white(), light)), what) for each, what in whites],
        "laboratory-white.png", 2.0)  # fmt: skip
    raws, pictures = [], []
    for m in (0.5, 0.25):
        camera = meant.replace(lenslets={"magnification": m})
        raw = lg.simulate(camera, lg.targets.usaf1951(camera.object_grid, 3), light)
        white = lg.simulate(camera, lg.targets.white(), light)
        even = lg.render(white, camera.calibration, camera.patch)
        picture = lg.render(raw, camera.calibration, camera.patch) / np.maximum(even, 0.05 * even.max())
        raws.append((_bright(raw), f"raw, m = {m:g}"))
        pictures.append((np.clip(picture / np.quantile(picture, 0.995), 0, 1), f"rendered, m = {m:g}"))
    row(raws, "laboratory-raw.png", 2.6)
    row(pictures, "laboratory-rendered.png", 2.6)


def _bright(raw: lg.RawImage) -> np.ndarray:
    data = np.asarray(raw.data)
    return np.clip(data / np.quantile(data, 0.995), 0, 1)


_IDLE = "!window.lumigraph || (lumigraph.ready && !document.getElementById('status').textContent)"


def screenshot(command: list[str], name: str, link: str = "") -> None:
    """Picture of the page that a command serves, with what a link says, in headless Chromium."""
    from playwright.sync_api import sync_playwright

    words = [str(Path(sys.executable).with_name("lumigraph")), *command, "--no-open"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server, sync_playwright() as play:
        try:
            lines = iter(server.stdout.readline, "")
            address = next(found[0] for line in lines if (found := re.search(r"http://\S+", line)))
            path = str(SYSTEM) if SYSTEM.exists() else None
            browser = play.chromium.launch(executable_path=path, args=FLAGS)
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(address + link, timeout=240_000)
            page.wait_for_load_state("networkidle", timeout=240_000)
            page.wait_for_timeout(15_000)
            while not page.evaluate(_IDLE):  # such as "Measuring depth"
                page.wait_for_timeout(1_000)
            page.wait_for_timeout(3_000)
            page.screenshot(path=STATIC / name, timeout=240_000)
            browser.close()
        finally:
            server.terminate()


PICTURES = (first, bench, laboratory, calibration, microscope, design, viewer, states, designer)


if __name__ == "__main__":
    for picture in PICTURES:
        if len(sys.argv) == 1 or picture.__name__ in sys.argv[1:]:
            print(picture.__name__, flush=True)
            picture()
