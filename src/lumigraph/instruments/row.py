"""`Row`: a named quantity, its value with a unit, and the equation it comes from."""

from dataclasses import dataclass
from typing import Any

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
