"""An exported page in Chromium with WebGL in software: first picture, frame times of drags, what axe finds.

`python -m benchmarks.page [PAGE.html ...]` opens pages that `lumigraph view FILE --export PAGE.html`
wrote, or one of the sample scene. "painted" is when the page had drawn its first picture and the next frame
began, by its own clock from the start of navigation; "seen" is when a frame of the browser's compositor first
showed a picture where it stands. Frame times are those between animation frames while focus or viewpoint move
with each. Needs playwright and Chromium; axe needs axe-playwright-python. Takes a minute.
"""

import base64
import importlib.util
import io
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import lumigraph as lg
from benchmarks.streaming import FLAGS, wait
from lumigraph import viewer
from lumigraph.viewer.opening import of_views

OPENINGS, FRAMES = 5, 60
_CONTRAST = 6.0  # grey levels, standard deviation: the ground before the picture is even
DRAG = """([frames, what]) => new Promise((done) => {
    const { app } = lumigraph, [low, high] = app.main.model.focus, times = [];
    const { shape } = app.main.model.views;
    const step = (now) => {
        times.push(now);
        if (times.length > frames) return done(times.slice(1).map((t, k) => t - times[k]));
        const part = (1 - Math.cos((Math.PI * times.length) / frames)) / 2;
        if (what === "focus") app.set({ focus: low + (high - low) * part });
        else app.set({ aperture: 0.001, view: [shape[0] / 2, (shape[1] - 1) * part] });
        requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
})"""


def seen(page: Any, address: str) -> tuple[float, float]:
    """Opens a page; when its first picture was painted by its clock, and seen by the compositor's [s]."""
    session, shots = page.context.new_cdp_session(page), []

    def shot(event: dict) -> None:
        shots.append((event["metadata"]["timestamp"], event["data"]))
        session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})

    session.on("Page.screencastFrame", shot)
    session.send("Page.startScreencast", {"format": "png", "maxWidth": 640, "maxHeight": 400})
    page.goto(address, wait_until="commit")
    wait(page, "Boolean(window.lumigraph?.app?.first)")
    wait(page, "Boolean(lumigraph.ready)")
    began, painted = page.evaluate("[performance.timeOrigin / 1e3, lumigraph.app.first / 1e3]")
    box = page.evaluate("lumigraph.app.main.stage.getBoundingClientRect().toJSON()")
    session.send("Page.stopScreencast")
    session.detach()
    part = [0.5 * (box["x"] + f * box["width"]) for f in (0.4, 0.6)]
    rows = [0.5 * (box["y"] + f * box["height"]) for f in (0.4, 0.6)]
    for when, data in shots:
        picture = Image.open(io.BytesIO(base64.b64decode(data))).convert("L")
        if np.std(np.asarray(picture.crop((part[0], rows[0], part[1], rows[1])))) > _CONTRAST:
            return painted, when - began
    return painted, float("nan")


def violations(page: Any) -> int | None:
    """What axe-core finds wrong; None where it is not installed."""
    found = importlib.util.find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        return None
    page.evaluate((Path(found.origin).parent / "axe.min.js").read_text("utf-8"))
    return page.evaluate("axe.run().then(({ violations }) => violations.length)")


def run(path: Path, browser: Any) -> list[str]:
    """Lines about one page."""
    lines, times = [f"{path.name}: {path.stat().st_size / 1e6:.2f} MB"], []
    for _ in range(OPENINGS):
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        times.append(seen(page, path.resolve().as_uri()))
        page.close()
    for what, each in zip(("painted", "seen"), np.array(times).T, strict=True):
        lines.append(f"first picture {what}: {np.median(each):.2f} s ({each.min():.2f} to {each.max():.2f})")
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(path.resolve().as_uri())
    wait(page, "Boolean(window.lumigraph?.ready && lumigraph.app.first)")
    ready = page.evaluate("performance.now()") / 1e3
    wait(page, "!lumigraph.app.main.model.slow || Boolean(lumigraph.app.main.model.arrays.stack)")
    time.sleep(2)
    took, slow = page.evaluate("[lumigraph.app.main.model.took, lumigraph.app.main.model.slow]")
    lines.append(f"refocuses: after {ready:.2f} s; one exact picture {took:.0f} ms, slow: {slow}")
    for what in ("focus", "viewpoint"):
        frames = page.evaluate(DRAG, [FRAMES, what])
        time.sleep(2)
        middle, late = np.percentile(frames, (50, 95))
        lines.append(f"frames of a {what} drag: median {middle:.0f} ms, 95th percentile {late:.0f} ms")
    count = violations(page)
    lines.append("axe: not installed" if count is None else f"axe: {count} violations")
    page.close()
    return lines


def main(paths: list[Path]) -> None:
    """Everything about some pages."""
    from playwright.sync_api import sync_playwright

    system = Path("/usr/bin/chromium")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(system) if system.exists() else None, args=FLAGS)
        for path in paths:
            print("\n".join(run(path, browser)))
        browser.close()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main([Path(name) for name in sys.argv[1:]])
    else:
        with tempfile.TemporaryDirectory() as place:
            written = viewer.export([of_views("scene", lg.samples.scene().views)], Path(place) / "scene.html")
            main([written.path])
