"""A page of text, tables and figures, written as one HTML file."""

import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from itertools import groupby
from typing import Any

from lumigraph.errors import FormatError
from lumigraph.io.target import write_bytes
from lumigraph.report.pictures import Picture, picture


@dataclass(frozen=True, slots=True)
class Text:
    """One paragraph, or lines kept as they are."""

    text: str
    kept: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under a header."""

    rows: tuple[tuple[str, ...], ...]
    header: tuple[str, ...] = ()
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Beside:
    """Pictures, and a paragraph that stands beside them."""

    text: str
    pictures: tuple[Picture, ...]


@dataclass(frozen=True, slots=True)
class PageFrame:
    """Another page inside this one, from a file in the same folder."""

    file: str
    title: str


@dataclass(slots=True)
class Section:
    """A part of a page under a heading; neighbouring figures stand side by side.

    A folded one shows its heading until it is clicked.
    """

    title: str
    folded: bool = False
    parts: list[Text | Table | Picture | Beside | PageFrame] = field(default_factory=list)

    def text(self, text: str) -> "Section":
        """Add paragraphs, parted by empty lines."""
        self.parts += [Text(" ".join(block.split())) for block in text.split("\n\n") if block.strip()]
        return self

    def lines(self, text: str) -> "Section":
        """Add lines that keep their line breaks and columns, such as a calibration's report."""
        self.parts.append(Text(text.strip("\n"), kept=True))
        return self

    def table(
        self,
        rows: Mapping[Any, Any] | Iterable[Sequence[Any]],
        *,
        header: Sequence[Any] = (),
        caption: str = "",
    ) -> "Section":
        """Add a table; a mapping makes one of two columns.

        Raises
        ------
        FormatError
            Rows of several lengths.
        """
        cells = tuple(tuple(map(str, row)) for row in (rows.items() if isinstance(rows, Mapping) else rows))
        lengths = {len(row) for row in cells} | ({len(header)} if header else set())
        if len(lengths) > 1:
            raise FormatError(f"the table {caption or self.title!r} has rows of {sorted(lengths)} cells.")
        self.parts.append(Table(cells, tuple(map(str, header)), caption))
        return self

    def figure(self, image: Any, caption: str, **options: Any) -> "Section":
        """Add an array (y, x[, 3]), a `RawImage` or a matplotlib figure; options of `pictures.picture`."""
        self.parts.append(picture(image, caption, **options))
        return self

    def beside(self, text: str, pictures: Iterable[Picture]) -> "Section":
        """Add pictures with a paragraph beside them; below them on a narrow screen."""
        self.parts.append(Beside(" ".join(text.split()), tuple(pictures)))
        return self

    def frame(self, file: str, title: str) -> "Section":
        """Show another page, a file that lies beside this one."""
        self.parts.append(PageFrame(file, title))
        return self

    @property
    def groups(self) -> list[tuple[str, list[Any]]]:
        """Parts in order, as (kind, parts); neighbouring figures make one group."""
        kinds = groupby(self.parts, key=lambda part: type(part).__name__.lower())
        return [(kind, list(parts)) for kind, parts in kinds]


@dataclass(slots=True)
class Page:
    """A report: a title, an introduction and sections; read again every `refresh` seconds, if above 0.

    Examples
    --------
    >>> import numpy as np
    >>> page = Page("Two pixels")
    >>> section = page.section("The picture").figure(np.array([[0.0, 1.0]]), "Dark and bright", zoom=50)
    >>> "Dark and bright" in page.html()
    True
    """

    title: str
    introduction: str = ""
    sections: list[Section] = field(default_factory=list)
    refresh: int = 0

    @property
    def framed(self) -> bool:
        """True if the page shows another."""
        return any(isinstance(part, PageFrame) for section in self.sections for part in section.parts)

    def section(self, title: str, *, folded: bool = False) -> Section:
        """Add a section and return it."""
        self.sections.append(Section(title, folded))
        return self.sections[-1]

    def made_by(self, command: str) -> Section:
        """Add the section that says how the page can be made again: the command, versions, the time."""
        section = self.section("How it was made").lines(command)
        made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        versions = {name: version(name) for name in ("lumigraph", "numpy", "scipy")}
        return section.table({**versions, "Python": platform.python_version(), "made": made})

    def html(self) -> str:
        """The page as one HTML document."""
        return _template().render(page=self, version=version("lumigraph"))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the page atomically.

        Raises
        ------
        FormatError
            The folder does not exist.
        """
        write_bytes(path, self.html().encode())


@cache
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(files("lumigraph.report").joinpath("page.html.j2").read_text("utf-8"))
