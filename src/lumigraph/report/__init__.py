"""Self-contained HTML pages: one file, no network, readable on paper and in the dark.

- `page`: `Page` and its `Section`s of text, tables and figures
- `pictures`: arrays and matplotlib figures as images inside the page
- `page.html.j2`: the template
"""

from lumigraph.report.page import Page, Section

__all__ = ["Page", "Section"]


def __dir__() -> list[str]:
    return __all__
