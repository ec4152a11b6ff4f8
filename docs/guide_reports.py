"""Pictures of guides that are those of a command's report, in docs/_static/guides.

Run: python docs/guide_reports.py [NAME ...], with names of `REPORTS` (a few minutes for all).
"""

import base64
import io
import os
import re
import sys
import tempfile
from pathlib import Path

from PIL import Image

import lumigraph as lg
from lumigraph.cli import main as lumigraph

GUIDES = Path(__file__).parent / "_static" / "guides"
COLOURS = 96
"""Of a picture's palette: curves and grey pictures need no more, and files are a quarter as large."""

REPORTS: dict[str, tuple[str, dict[int, str]]] = {
    "sweep": (
        "sweep thesis-plenoptic-2-m050 --vary 'lenslets.focal_length=4 mm:6 mm:x9' "
        "--vary lenslets.magnification=0.3,0.5 --measure 'views per axis, lateral resolution'",
        {0: "sweep-views", 1: "sweep-resolution"},
    ),
    "tolerance": (
        "tolerance thesis-plenoptic-2-m050 -t 'separation=±0.05 mm' -t 'lenslet_distance=±0.02 mm' "
        "-t 'lenslets.focal_length=±1 %' -t 'main_lens.focal_length=±0.2 %' -n 1000",
        {0: "tolerance-focus", 1: "tolerance-depth", 2: "tolerance-blur", 3: "tolerance-resolution"},
    ),
    "information": (
        "information lfm-fourier --depth '-20 um:20 um:x9' --photons 5000",
        {0: "information"},
    ),
    "optimise": (
        "optimise lfm-fourier --vary 'fourier_lens=60 mm:110 mm:x3' --vary 'lenslets.pitch=1 mm:1.75 mm:x3' "
        "--depth '-20 um:20 um:20 um' --photons 5000 --places 1 --evaluations 16 --against lateral",
        {0: "optimise-before-after", 1: "optimise-front", 2: "optimise-search"},
    ),
    "optimise-pictures": (
        "optimise thesis-plenoptic-2-m050 --vary 'lenslets.magnification=0.3:0.6:x3' --goal 'picture error' "
        "--depth '-5 mm:5 mm:5 mm' --photons 3000 --scenes a.png b.png --held-out c.png d.png "
        "--scene-pitch '40 um' --scene-samples 12 --evaluations 4",
        {0: "scenes-before-after", 1: "scenes-reconstructed"},
    ),
}
"""Commands, and what their report's pictures are called, by their number."""


def pictures(page: str) -> list[bytes]:
    """The pictures of a report (PNG), in order."""
    return [base64.b64decode(one) for one in re.findall(r'src="data:image/png;base64,([^"]+)"', page)]


def keep(content: bytes, name: str) -> None:
    """Write a picture (PNG) with a palette."""
    GUIDES.mkdir(exist_ok=True)
    image = Image.open(io.BytesIO(content)).convert("RGB")
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(GUIDES / f"{name}.png", optimize=True)


def scenes() -> None:
    """Pictures of scikit-image in the folder, at a quarter of their samples: a.png to d.png."""
    from skimage import data
    from skimage.transform import downscale_local_mean

    for name, picture in zip("abcd", (data.camera, data.brick, data.coins, data.gravel), strict=True):
        lg.save(downscale_local_mean(picture(), (4, 4)) / 255, f"{name}.png")


def report(name: str) -> None:
    """Run a command and keep its report's pictures."""
    import shlex

    command, wanted = REPORTS[name]
    words = shlex.split(command)
    ending = {"sweep": ["-o", "out.csv"], "tolerance": ["-o", "out.csv"], "information": []}
    if lumigraph([*words, *ending.get(words[0], ["-o", "out.toml"]), "--report", "page.html"]):
        raise SystemExit(f"{name} failed")
    found = pictures(Path("page.html").read_text("utf-8"))
    for number, picture in wanted.items():
        keep(found[number], picture)


def main() -> None:
    """Make the reports that are named, or all."""
    start = Path.cwd()
    for name in REPORTS:
        if len(sys.argv) == 1 or name in sys.argv[1:]:
            print(name, flush=True)
            with tempfile.TemporaryDirectory() as folder:
                os.chdir(folder)
                scenes()
                report(name)
                os.chdir(start)


if __name__ == "__main__":
    main()
