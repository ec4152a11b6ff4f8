"""What the theme and its extensions leave out for those who read with a keyboard or a screen reader."""

import re
from pathlib import Path
from typing import Any

CHANGES = (
    (r'role="heading">', 'role="heading" aria-level="2">'),
    (r'<aside class="sidebar-drawer">', '<aside class="sidebar-drawer" aria-label="Pages of this site">'),
    (r'<aside class="toc-drawer">', '<aside class="toc-drawer" aria-label="On this page">'),
    (r'<th class="head">(?:<p></p>)?</th>', "<td></td>"),
    (r"<pre>", '<pre tabindex="0">'),
    (
        r'(sphx-glr-thumbcontainer" tooltip="[^"]*"><img alt="" [^>]*>\s*<p><a )'
        r'(class="[^"]*" href="[^"]*"><span class="doc">)([^<]*)',
        r'\1aria-label="\3" \2\3',
    ),
    (r'<div id="search-results">', '<h1>Search</h1>\n<div id="search-results">'),
)
"""Patterns, and what takes their place: levels, names, cells without a heading, code that scrolls by keys."""


def finish(app: Any, error: Exception | None) -> None:
    """Change the pages that were written."""
    if error is not None:
        return
    for path in Path(app.outdir).rglob("*.html"):
        if "_static" in path.parts or "_images" in path.parts:
            continue
        before = text = path.read_text("utf-8")
        for pattern, instead in CHANGES:
            text = re.sub(pattern, instead, text)
        if text != before:
            path.write_text(text, "utf-8")
