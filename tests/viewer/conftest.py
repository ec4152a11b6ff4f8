"""A headless Chromium where there is one, and pages in it."""

import importlib.util
from pathlib import Path

import pytest

from viewer_pages import Page, two_planes

SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@pytest.fixture(scope="session")
def views():
    return two_planes()


@pytest.fixture(scope="module")  # while it lives, its event loop occupies the thread
def browser():
    """Headless Chromium with WebGL in software; tests are skipped where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    system = Path("/usr/bin/chromium")
    with sync_api.sync_playwright() as play:
        try:
            found = play.chromium.launch(
                executable_path=str(system) if system.exists() else None, args=SOFTWARE
            )
        except sync_api.Error as error:
            pytest.skip(f"no Chromium here: {str(error).splitlines()[0]}")
        yield found
        found.close()


@pytest.fixture
def open_page(browser):
    pages = []

    def opened(address, **options):
        pages.append(Page(browser, address, **options))
        return pages[-1]

    yield opened
    for page in pages:
        page.close()
        assert not page.complaints


RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


@pytest.fixture(scope="session")
def violations():
    """Function of a page: what axe-core finds wrong with it, and where."""
    found = importlib.util.find_spec("axe_playwright_python")
    if found is None:
        pytest.skip("axe-playwright-python is not installed")
    script = (Path(found.origin).parent / "axe.min.js").read_text("utf-8")

    def checked(page):
        page.evaluate(script)
        result = page.evaluate("rules => axe.run({runOnly: rules})", RULES)
        assert result["passes"]
        return [(v["id"], [node["target"] for node in v["nodes"]]) for v in result["violations"]]

    return checked
