"""A light field of 2 GB as a folder: how soon a page shows it, and what it loads, from a server of files.

`python -m benchmarks.streaming [FOLDER]` writes the light field and the page into FOLDER (a temporary one if
left out, removed at the end), opens the page in headless Chromium with WebGL in software, and prints times,
bytes and memory. Needs playwright and Chromium, 3 GB of disk and 3 minutes.
"""

import functools
import http.server
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from PIL import Image

import lumigraph as lg
from lumigraph import viewer
from lumigraph.viewer.opening import of_views

TIMES = 13
"""Samples across for each of the sample scene's."""

FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--enable-precise-memory-info"]  # fmt: skip
LOOKS = {
    "whole picture": {}, "4 times larger": {"zoom": 4},
    "one view": {"zoom": 1, "at": None, "aperture": 0.001},
}  # fmt: skip
FINER = "lumigraph.app.main.model.finer.views"


def large(folder: Path) -> lg.LightField:
    """The sample scene, enlarged, with grain, in a file."""
    small = lg.samples.scene().views
    data = np.asarray(small.data)
    data = (
        data if data.dtype == np.uint8 else np.rint(np.clip(data / data.max(), 0, 1) * 255).astype(np.uint8)
    )
    shape = (*data.shape[:2], data.shape[2] * TIMES, data.shape[3] * TIMES, *data.shape[4:])
    full = np.memmap(folder / "views.raw", np.uint8, "w+", shape=shape)
    rng = np.random.default_rng(1)
    grain = rng.integers(-6, 7, shape[2:4] + (1,) * (len(shape) - 4)).astype(np.int16)  # what cameras add
    for v, u in np.ndindex(shape[:2]):
        view = Image.fromarray(data[v, u]).resize((shape[3], shape[2]), Image.Resampling.BICUBIC)
        full[v, u] = np.clip(np.asarray(view) + np.roll(grain, (v, 3 * u), (0, 1)), 0, 255)
    aperture, old = small.aperture, small.lenslets
    grid = lg.Grid(shape[2:4], (old.pitch[0] / TIMES, old.pitch[1] / TIMES), old.center)
    return lg.LightField(full, aperture, grid, small.separation)


class Counting(http.server.SimpleHTTPRequestHandler):
    """Sends files and adds up their bytes."""

    sent = 0

    def log_message(self, *_):
        """Nothing is printed."""

    def copyfile(self, source, outputfile):
        """Send a file."""
        content = source.read()
        Counting.sent += len(content)
        outputfile.write(content)


def wait(page, condition: str) -> float:
    """Time at which a condition holds."""
    end = time.monotonic() + 120
    while not page.evaluate(condition):
        if time.monotonic() > end:
            raise SystemExit(f"{condition} never came: {page.inner_text('#status')}")
        time.sleep(0.01)
    return time.monotonic()


def at_rest(page) -> float:
    """Time since which nothing has been loaded or drawn any more for a second."""
    busy = f"{FINER}.loading || ({FINER}.window && (!{FINER}.window.drawn || {FINER}.window.work))"
    last = time.monotonic()
    while time.monotonic() < last + 1:
        if page.evaluate(f"(lumigraph.app.schedule(), Boolean({busy}))"):
            last = time.monotonic()
        time.sleep(0.05)
    return last


def measure(page, address: str) -> None:
    """Opens the page and prints what came when."""
    page.goto(address, wait_until="commit")
    wait(page, "Boolean(window.lumigraph?.app?.first)")
    first = page.evaluate("lumigraph.app.first") / 1e3
    print(f"first picture: {first:.2f} s, at most {Counting.sent / 1e6:.1f} MB")
    wait(page, "Boolean(lumigraph.ready)")
    ready = page.evaluate("performance.now()") / 1e3
    print(f"refocuses: {ready:.2f} s, {Counting.sent / 1e6:.1f} MB")
    for what, state in LOOKS.items():
        page.evaluate("state => lumigraph.set(state)", state)
        began, before = time.monotonic(), Counting.sent
        ended = at_rest(page)
        memory = page.evaluate("performance.memory.usedJSHeapSize") / 1e6
        step = page.evaluate(f"{FINER}.window?.step ?? {FINER}.coarsest")
        loaded = (Counting.sent - before) / 1e6
        print(
            f"{what}: every {step} samples, {ended - began:.1f} s, {loaded:.1f} MB more, heap {memory:.0f} MB"
        )


def main(folder: Path) -> None:
    """Everything, in a folder."""
    from playwright.sync_api import sync_playwright

    views = large(folder)
    print(f"{views.data.shape}: {views.data.nbytes / 1e9:.2f} GB")
    began, used = time.monotonic(), time.process_time()
    written = viewer.export_folder([of_views("large", views)], folder / "page")
    cpu, wall = time.process_time() - used, time.monotonic() - began
    print(f"written: {written.size / 1e6:.0f} MB in {written.files} files, {cpu:.0f} CPU s, {wall:.0f} s")
    handler = functools.partial(Counting, directory=folder / "page")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    system = Path("/usr/bin/chromium")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(system) if system.exists() else None, args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        measure(page, f"http://127.0.0.1:{server.server_port}/")
        page.screenshot(path=folder / "page.png")
        browser.close()
    server.shutdown()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as place:
            main(Path(place))
