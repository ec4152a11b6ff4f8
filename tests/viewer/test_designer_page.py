"""The designer's page in a browser: a slider changes what is drawn, computed and saved."""

import threading
import time
from contextlib import contextmanager

import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.viewer import safety
from lumigraph.viewer.server import LOOPBACK, _listener, application

IDLE = "window.lumigraph && Object.values(lumigraph.askers).every((each) => each.answered && !each.busy)"


@contextmanager
def designer(name):
    import uvicorn

    listener = _listener(LOOPBACK, 0)
    port = listener.getsockname()[1]
    site = viewer.designer_site(lg.load_camera(name), name)
    app = application(site, "token", safety.hosts(port))
    server = uvicorn.Server(uvicorn.Config(app, log_level="critical", lifespan="off", ws="none"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        yield f"http://{LOOPBACK}:{port}/token/"
    finally:
        server.should_exit = True
        thread.join(10)
        listener.close()


def settle(page):
    end = time.monotonic() + 300
    while not page.evaluate(IDLE):
        assert time.monotonic() < end, page.inner_text("#status")
        time.sleep(0.02)


@pytest.fixture
def page(browser):
    context = browser.new_context(viewport={"width": 390, "height": 844})
    yield context.new_page()
    context.close()


def test_values_change_everything_and_wrong_ones_are_told(page, tmp_path):
    with designer("thesis-plenoptic-1") as address:
        page.goto(address)
        settle(page)
        before = page.get_attribute("#point", "src"), page.get_attribute("#drawing", "src")
        page.fill("[id='lenslets.pitch']", "200")
        page.press("[id='lenslets.pitch']", "Tab")
        settle(page)
        assert 'pitch = "200 um"' in page.text_content("#toml")
        assert "200 µm" in page.inner_text("#tables")
        assert page.get_attribute("#point", "src") != before[0]
        assert page.get_attribute("#drawing", "src") != before[1]
        assert page.locator(".chart circle").count() == 6
        with page.expect_download() as download:
            page.click("#save")
        saved = tmp_path / "camera.toml"
        download.value.save_as(saved)
        camera = lg.load_camera(str(saved))
        assert camera.lenslets.pitch == pytest.approx(200e-6)
        assert camera.replace(lenslets={"pitch": 150e-6}) == lg.load_camera("thesis-plenoptic-1")
        page.fill("[id='object_distance']", "100")
        page.press("[id='object_distance']", "Tab")
        settle(page)
        assert "inside the main lens' focal length" in page.inner_text("#warnings")
        assert page.is_disabled("#save")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_place_is_kept_for_pictures_that_are_not_there_yet(page):
    unanswered = page.context.new_page()  # by a script: requests that playwright holds can block it for ever
    unanswered.add_init_script(
        "const ask = fetch; fetch = (...all) =>"
        " /call.(layout|point)/.test(all[0]) ? new Promise(() => {}) : ask(...all);"
    )
    with designer("thesis-plenoptic-1") as address:
        unanswered.goto(address)
        for box, words in (("#rays", "Drawing …"), ("#spot", "Simulating …")):
            unanswered.wait_for_selector(f"{box} .hint")
            assert unanswered.inner_text(box) == words
            assert unanswered.locator(box).bounding_box()["height"] > 100
        page.goto(address)
        settle(page)
        assert page.inner_text("#rays") == page.inner_text("#spot") == ""


def test_a_link_restores_the_values(page):
    with designer("thesis-plenoptic-2-m050") as address:
        page.goto(f"{address}#lenslets.magnification=0.4&dz=5&lenslets.pitch=x&unknown=1")
        settle(page)
        assert "magnification = 0.4" in page.text_content("#toml")
        assert page.inner_text("#depth-out") == "5 mm, farther"


def test_the_designer_is_accessible(page, violations):
    with designer("lfm-guv") as address:
        page.goto(address)
        settle(page)
        assert violations(page) == []
