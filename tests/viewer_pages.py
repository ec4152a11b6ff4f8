"""A light field of two planes, and pages of the viewer in a browser; used by the tests of the viewer."""

import base64
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.viewer.server import LOOPBACK, application

NEAR, FAR = 0.9, 1.15  # refocus factors of the two planes of `two_planes`


def two_planes(dtype=np.uint8, top=255):
    """5 × 5 views of 40 × 64 px, RGB: the left half of the picture lies at NEAR, the right half at FAR."""
    rng = np.random.default_rng(7)
    aperture, lenslets = lg.Grid((5, 5), 10.0), lg.Grid((40, 64), 1.0)
    y, x = np.mgrid[0:40, 0:64].astype(float)
    waves = rng.uniform(0.15, 0.5, (12, 3)), rng.uniform(-0.5, 0.5, (12, 3)), rng.uniform(0, 6, (12, 3))
    data = np.zeros((5, 5, 40, 64, 3))
    for v, yv in enumerate(aperture.y):
        for u, xu in enumerate(aperture.x):
            near = x < 32
            shift = np.where(near, 1 - NEAR, 1 - FAR)
            ys, xs = y - yv * shift, x - xu * shift
            picture = sum(
                np.sin(a * ys[..., None] + b * xs[..., None] + c) for a, b, c in zip(*waves, strict=True)
            )
            data[v, u] = picture / 12
    data = 0.5 + 0.9 * data
    return lg.LightField((np.clip(data, 0, 1) * top).astype(dtype), aperture, lenslets, 200.0)


@contextmanager
def served(*exhibits):
    """The address of a page, answered while the block runs."""
    import uvicorn

    from lumigraph.viewer import safety
    from lumigraph.viewer.server import _listener

    listener = _listener(LOOPBACK, 0)
    port = listener.getsockname()[1]
    app = application(viewer.site(exhibits), "token", safety.hosts(port))
    server = uvicorn.Server(uvicorn.Config(app, log_level="critical", lifespan="off", ws="none"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        yield f"http://{LOOPBACK}:{port}/token/"
    finally:
        server.should_exit = True
        thread.join(10)
        listener.close()


class Page:
    """One page of the viewer, and what its console complained about."""

    def __init__(self, browser, address, **options):
        self.context = browser.new_context(**({"viewport": {"width": 800, "height": 480}} | options))
        self.page = self.context.new_page()
        self.complaints = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda m: m.type == "error" and self.complaints.append(m.text))
        self.page.goto(address)
        self.wait("Boolean(window.lumigraph?.ready && lumigraph.app.first)")

    def wait(self, condition, seconds=30):
        """Until a condition of JavaScript holds; the page's policy forbids playwright's own way."""
        end = time.monotonic() + seconds
        while not self.page.evaluate(condition):
            assert time.monotonic() < end, (condition, self.page.inner_text("#status"), self.complaints)
            time.sleep(0.02)

    def says(self, selector, text):
        """Until an element says a text; the page writes with the next frame."""
        self.wait(f"document.querySelector({selector!r}).innerText === {text!r}")

    def set(self, **state):
        self.page.evaluate("state => lumigraph.set(state)", state)

    def pixels(self, pane=0):
        """The picture as it is shown, in its own size (y, x, 3)."""
        got = self.page.evaluate(
            """pane => { const p = lumigraph.pixels(pane); let text = "";
            for (const byte of p.data) text += String.fromCharCode(byte);
            return [p.height, p.width, btoa(text)]; }""",
            pane,
        )
        data = np.frombuffer(base64.b64decode(got[2]), np.uint8)
        return data.reshape(got[0], got[1], 4)[..., :3].astype(float)

    def state(self, name):
        return self.page.evaluate("name => lumigraph.app.state[name]", name)

    def window_place(self, y, x):
        """Where a place of the picture stands in the window (x, y)."""
        return self.page.evaluate(
            "([y, x]) => { const p = lumigraph.app.main, b = p.stage.getBoundingClientRect(),"
            " s = p.toScreen(y, x); return [s[0] + b.left, s[1] + b.top]; }",
            [y, x],
        )

    def click_at(self, y, x):
        """A click at a place of the picture."""
        self.page.mouse.click(*self.window_place(y, x))

    def close(self):
        self.context.close()


def frames_of(path):
    """Times [s] and pictures of a film, and how long it is."""
    av = pytest.importorskip("av", reason="PyAV is not installed")
    with av.open(str(path)) as container:
        (stream,) = container.streams.video
        assert float(stream.average_rate) == 25
        pictures = [
            (float(frame.time), frame.to_ndarray(format="rgb24").astype(float))
            for frame in container.decode(stream)
        ]
        return (
            [time for time, _ in pictures],
            np.array([picture for _, picture in pictures]),
            container.duration / 1e6,
        )


def film(page, what, seconds, path):
    """Save a film; the name that the page gives it."""
    page.page.click("#save-film")
    page.page.select_option("#film-what", what)
    page.page.fill("#film-seconds", str(seconds))
    with page.page.expect_download() as download:
        page.page.click("#film-start")
    download.value.save_as(path)
    return download.value.suggested_filename
