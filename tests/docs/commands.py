"""The commands of README.md and of the tutorials, run one after the other as a reader would.

    python tests/docs/commands.py FOLDER [PAGE ...]

Runs in an empty folder, with the Python whose lumigraph is meant; needs nothing but lumigraph.
"""

import re
import shlex
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", *(f"docs/tutorials/{name}.md" for name in ("first-picture", "design", "microscope")))
EXCUSED = {
    r"^(make|pip|python3|source|\.venv/bin|\.ci/run)\b": "sets lumigraph up, or works on its sources",
    r"^lumigraph optimise camera\.toml": "a search: some minutes",
    r"^lumigraph deconvolve raw\.tif .*lfm-guv": "the reader's own raw image",
}
"""Commands that are not run, and why."""
SERVING = re.compile(r"^lumigraph (view\b(?!.*--export)|design\b.*--web)")
"""Commands that go on until they are stopped: their page is fetched."""


def blocks(page: str, language: str) -> list[str]:
    """The fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", (ROOT / page).read_text("utf-8"), re.M | re.S)


def commands(page: str) -> Iterator[str]:
    """Every command of a page, in order, continued lines joined, without remarks."""
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            if command := re.sub(r"\s+#.*", "", line).strip():
                yield command


def excuse(command: str) -> str | None:
    """Why a command is not run."""
    return next((why for pattern, why in EXCUSED.items() if re.search(pattern, command)), None)


def run(command: str, folder: Path) -> None:
    """Run a command in a folder; a page that it serves is fetched, then it is stopped."""
    words = [str(Path(sys.executable).with_name("lumigraph")), *shlex.split(command)[1:]]
    if not SERVING.search(command):
        subprocess.run(words, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        return
    log = folder / "served.txt"
    with log.open("w") as out, subprocess.Popen([*words, "--no-open"], cwd=folder, stdout=out) as server:
        try:
            page = urllib.request.urlopen(address(log, server), timeout=60).read()
        finally:
            server.terminate()
    if b"lumigraph" not in page:
        raise RuntimeError(f"{command}: its page has {len(page)} bytes and no lumigraph in it")


def address(log: Path, server: subprocess.Popen) -> str:
    """Where a command serves its page, as soon as it says so."""
    for _ in range(1200):
        if found := re.search(r"http://\S+", log.read_text()):
            return found[0]
        if server.poll() is not None:
            break
        time.sleep(0.25)
    raise RuntimeError(f"{shlex.join(server.args)} served no page")


def own_files(page: str, folder: Path) -> None:
    """What a reader has before: the page's camera file, a picture with an edge, exposures of a sensor."""
    import numpy as np

    import lumigraph as lg

    (folder / "camera.toml").write_text(blocks(page, "toml")[0])
    y, x = np.mgrid[:200, :200] - 100.0
    lg.save(np.clip(x + 20 - 0.09 * (y + 40), 0, 1).astype(np.float32), folder / "picture.tiff")
    rng, sensor = np.random.default_rng(0), lg.Sensor((200, 200), 5e-6, read_noise=8.0, black_level=50)
    for name, light in (("a", 0.2), ("b", 0.5), ("d", 0.0)):
        for k in (1, 2):
            flat = sensor.expose(np.full((200, 200), light), photons=9000, rng=rng)
            lg.save(flat, folder / f"{name}{k}.tiff")


def main(folder: Path, pages: tuple[str, ...] = PAGES) -> None:
    """Run the pages' commands, each page in a folder of its own."""
    for page in pages:
        inside = folder / Path(page).stem
        inside.mkdir(parents=True)
        own_files(page, inside)
        for command in commands(page):
            why = excuse(command)
            print(f"{command}" + (f"    not run: {why}" if why else ""), flush=True)
            if why is None:
                run(command, inside)


if __name__ == "__main__":
    main(Path(sys.argv[1]), tuple(sys.argv[2:]) or PAGES)
