"""Guides have pictures; what the site's pages lack for a keyboard or a screen reader is put in."""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
GUIDES = [
    page
    for kind in ("tutorials", "how-to", "explanations")
    for page in sorted(ROOT.glob(f"docs/{kind}/*.md"))
    if page.stem != "index"
]
GALLERY = re.compile(r"sphx_glr_(plot_\w+)_(\d{3})\.png$")


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.stem)
def test_a_guide_has_two_pictures_that_are_there(page):
    """Those of the gallery are made when the site is built: their script is there."""
    text = page.read_text("utf-8")
    pictures = re.findall(r"^```\{image\} (\S+)|!\[[^\]]*\]\(([^)]+)\)", text, re.M)
    assert len(pictures) >= 2
    assert text.count("```{image}") == len(re.findall(r"^:alt: \S", text, re.M))
    for name in map("".join, pictures):
        made = GALLERY.search(name)
        wanted = ROOT / f"examples/gallery/{made[1]}.py" if made else page.parent / name
        assert wanted.is_file(), name


def test_what_the_theme_leaves_out_is_put_in(tmp_path):
    page = tmp_path / "index.html"
    page.write_text(
        '<p class="caption" role="heading">How-to</p><aside class="toc-drawer"><pre>code</pre>'
        '<th class="head"><p></p></th><div class="sphx-glr-thumbcontainer" tooltip="t">'
        '<img alt="" src="a.png" />\n'
        '<p><a class="reference internal" href="a.html"><span class="doc">A lens</span></a></p>'
    )
    finish = runpy.run_path(str(ROOT / "docs/accessible.py"))["finish"]
    finish(SimpleNamespace(outdir=tmp_path), None)
    text = page.read_text()
    for part in (
        'role="heading" aria-level="2"',
        '<aside class="toc-drawer" aria-label="On this page">',
        '<pre tabindex="0">',
        "<td></td>",
        '<a aria-label="A lens" class="reference internal"',
    ):
        assert part in text
