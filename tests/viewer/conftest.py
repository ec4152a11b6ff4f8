"""A headless Chromium where there is one, and pages in it."""

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
