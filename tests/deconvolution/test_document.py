"""Pages about deconvolution: its programs run, its commands exist."""

import re
from pathlib import Path

import numpy as np

DOCS = Path(__file__).parents[2] / "docs"
PAGES = ("how-to/deconvolution.md", "explanations/deconvolution.md", "how-to/several-raw-images.md")


def blocks(language):
    text = "\n".join((DOCS / page).read_text("utf-8") for page in PAGES)
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


def test_its_programs_run_from_top_to_bottom():
    names = {}
    for code in blocks("python"):
        exec(compile(code, PAGES[0], "exec"), names)
    scene = names["edge"].parts[0].intensity
    inner = (slice(4, -4), slice(4, -4))
    for name in ("picture", "even"):
        found = np.asarray(names[name].data)
        assert np.corrcoef(found[inner].ravel(), scene[inner].ravel())[0, 1] > 0.9


def test_its_commands_are_understood():
    from lumigraph.cli.app import app

    for line in blocks("sh")[0].splitlines():
        app.parse_args(line.removeprefix("lumigraph "), print_error=False, exit_on_error=False)
