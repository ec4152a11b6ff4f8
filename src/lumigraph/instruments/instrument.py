"""Reading, checking, changing and writing the description of an instrument."""

from collections.abc import Mapping
from os import PathLike
from typing import Any, ClassVar, Self

from pydantic import ValidationError

from lumigraph.core.drawing import draw
from lumigraph.errors import FormatError
from lumigraph.instruments import files
from lumigraph.instruments.description import Description
from lumigraph.instruments.parts import Part
from lumigraph.instruments.problems import readable
from lumigraph.instruments.quantities import FROM_FILE
from lumigraph.instruments.row import Row
from lumigraph.instruments.trade_offs import Range


class Instrument(Part):
    """What a camera file describes; see its children."""

    KIND: ClassVar[str]

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Self:
        """The camera that a TOML file describes.

        Raises
        ------
        FormatError
            No such file, damaged TOML, another kind of camera, an unknown or missing key, or a wrong unit.
        GeometryError
            Values that no camera can have.
        """
        return cls.from_table(files.read(path), str(path))

    @classmethod
    def from_catalogue(cls, name: str) -> Self:
        """A camera that comes with lumigraph; `lumigraph.catalogue` lists them.

        Raises
        ------
        FormatError
            No such name, or another kind of camera.
        """
        return cls.from_table(files.read_catalogue(name), name)

    @classmethod
    def from_table(cls, table: Mapping[str, Any], origin: str = "the camera file") -> Self:
        """The camera of a parsed TOML file, whose lengths carry a unit; `origin` is named in errors."""
        kind = files.kind(table, origin)
        if kind != cls.KIND:
            raise FormatError(
                f"{origin} describes a {kind!r} camera, not a {cls.KIND!r}. Use lumigraph.load_camera, which "
                "takes every kind."
            )
        values = {key: value for key, value in table.items() if key != "kind"}
        try:
            return cls.model_validate(values, context=FROM_FILE)
        except ValidationError as error:
            problem = readable(error, cls)
            raise type(problem)(f"{origin}: {problem}") from None

    def to_toml(self) -> str:
        """The description as the text of a camera file; what is computed is left out."""
        return files.write({"kind": self.KIND, **self.model_dump(by_alias=True, exclude_defaults=True)})

    def _repr_html_(self) -> str:
        return self.describe()._repr_html_()

    def plot(self) -> Any:
        """A matplotlib Figure of its layout with rays: `lumigraph.plots.layout`."""
        return draw("layout", self)

    def describe(self) -> Description:
        """The table of everything that follows from the description."""
        raise NotImplementedError

    def quantities(self) -> tuple[Row, ...]:
        """All that follows from the description: names, values in SI, units and equations."""
        return self.describe().rows

    def trade_offs(self) -> tuple[Row, ...]:
        """Those of the `quantities` that change with the magnification, to first order."""
        raise NotImplementedError

    def magnifications(self) -> Range:
        """Magnifications over which the trade-offs are worth a look."""
        raise NotImplementedError

    def replace(self, **changes: Any) -> Self:
        """The camera with other values; a mapping changes only the keys it has.

        Examples
        --------
        ``camera.replace(object_distance="130 mm", lenslets={"magnification": 0.3})``
        """
        values = self.model_dump(by_alias=True)
        for key, change in changes.items():
            table = values.get(key)
            merge = isinstance(change, Mapping) and isinstance(table, dict)
            values[key] = {**table, **change} if merge else change  # type: ignore[dict-item]
        return type(self)(**values)
