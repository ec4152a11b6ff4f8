"""`Description`: rows of quantities by section, with warnings; `Row`: one quantity."""

from dataclasses import dataclass
from typing import Any

from lumigraph.core import picture

_PREFIXES = {
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")),
    "1/m": ((1e3, "/mm"), (1.0, "/m")),
    "rad": ((1.0, "rad"), (1e-3, "mrad"), (1e-6, "µrad")),
}


@dataclass(frozen=True, slots=True)
class Row:
    """One line: a name, a value in SI, its SI unit ("" for a number), and where it comes from."""

    name: str
    value: Any
    unit: str = ""
    source: str = ""

    @property
    def scale(self) -> tuple[float, str]:
        """The unit that suits the value's size: how large it is in SI, and how it is written."""
        prefixes = _PREFIXES.get(self.unit, ((1.0, self.unit),))
        return next((p for p in prefixes if abs(self.value) >= p[0] * 0.99999), prefixes[-1])

    @property
    def text(self) -> str:
        """The value in a unit that suits its size."""
        if isinstance(self.value, tuple):
            return " x ".join(Row("", each, self.unit).text for each in self.value)
        if isinstance(self.value, str | int):
            return str(self.value)
        size, unit = self.scale
        return f"{self.value / size:.5g} {unit}".strip()


TRADE_OFFS = "Trade-offs"
"""Title of the section whose rows change with the magnification."""

_COMPUTING = "Simulation"
"""Title of the section about samples, which a notebook leaves out."""


@dataclass(frozen=True, slots=True, repr=False)
class Description:
    """A camera's table: rows by section, and warnings; `str` gives it as text."""

    title: str
    sections: tuple[tuple[str, tuple[Row, ...]], ...]
    warnings: tuple[str, ...]

    @property
    def rows(self) -> tuple[Row, ...]:
        """All rows, section after section."""
        return tuple(row for _, rows in self.sections for row in rows)

    def as_dict(self) -> dict[str, Any]:
        """Values in SI by name, for programs; "warnings" holds the warnings."""
        return {**{row.name: row.value for row in self.rows}, "warnings": list(self.warnings)}

    def _repr_html_(self) -> str:
        chosen = [row for title, rows in self.sections if title != _COMPUTING for row in rows]
        warned = [("warning", text) for text in self.warnings]
        rows = [(row.name, f"{row.text}   {row.source and f'({row.source})'}".rstrip()) for row in chosen]
        return picture.card(f"{self.title[0].upper()}{self.title[1:]}", [*warned, *rows])

    def __repr__(self) -> str:
        return f"Description({self.title!r}, {len(self.rows)} rows in {len(self.sections)} sections)"

    def __str__(self) -> str:
        name, value = (max(len(getattr(row, part)) for row in self.rows) for part in ("name", "text"))
        lines = [self.title]
        for section, rows in self.sections:
            lines += ["", section]
            lines += [f"  {row.name:<{name}}  {row.text:>{value}}   {row.source}".rstrip() for row in rows]
        if self.warnings:
            lines += ["", "Warnings", *(f"  {warning}" for warning in self.warnings)]
        return "\n".join(lines)
