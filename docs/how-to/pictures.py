"""The pictures of docs/how-to/process.md, by the commands that stand there.

Run: python docs/how-to/pictures.py
"""

import shutil
import tempfile
from pathlib import Path

from lumigraph.cli import main as lumigraph

STATIC = Path(__file__).parents[1] / "_static"


def main() -> None:
    """Make the bench sample, process it, and keep its sharp picture and its film."""
    with tempfile.TemporaryDirectory() as name:
        folder, results = Path(name), Path(name) / "results"
        given = [str(folder / f"bench-{what}") for what in ("raw.tiff", "white.tiff", "camera.toml")]
        lumigraph(["samples", "make", "bench", "-o", str(folder)])
        lumigraph(["process", given[0], "--white", given[1], "--camera", given[2], "-o", str(results)])
        shutil.copy(results / "all-in-focus.png", STATIC / "process-all-in-focus.png")
        shutil.copy(results / "refocus.gif", STATIC / "process-refocus.gif")


if __name__ == "__main__":
    main()
