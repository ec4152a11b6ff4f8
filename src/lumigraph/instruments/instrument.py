"""Reading, checking, changing and writing the description of an instrument."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import Any, ClassVar, Self

from pydantic import ValidationError

from lumigraph.core import upper_floors
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.core.progress import Progress
from lumigraph.design.layout import Layout, MicroscopeLayout
from lumigraph.errors import FormatError
from lumigraph.instruments import files
from lumigraph.instruments.description import Description, Row
from lumigraph.instruments.parameters import MagnificationRange, Parameter, changes
from lumigraph.instruments.part import CameraTable
from lumigraph.instruments.point_view import PointImage
from lumigraph.instruments.problems import readable
from lumigraph.instruments.quantities import FROM_FILE
from lumigraph.operators.sampling.sampling_rules import SamplingRules
from lumigraph.sensor import Sensor


class Instrument(CameraTable):
    """Base of everything that a camera file describes; see its children.

    The protocols of `instruments.capabilities` say what only some kinds can do. What raises
    NotImplementedError here, every kind has in its own way.
    """

    KIND: ClassVar[str]

    @property
    def noun(self) -> str:
        """Name in messages: its kind in camera files."""
        return self.KIND

    @property
    def sensor(self) -> Sensor:
        """Sensor: the pixels."""
        raise NotImplementedError

    @property
    def pupil_diameter(self) -> float:
        """Diameter of the stop that limits the light [m]."""
        raise NotImplementedError

    @property
    def object_grid(self) -> Grid:
        """Samples of the focused plane."""
        raise NotImplementedError

    @property
    def scene_grid(self) -> Grid:
        """Samples that pictures in the focused plane are drawn on."""
        return self.object_grid

    @cached_property
    def calibration(self) -> Calibration | None:
        """Calibration of the raw image [px]; None without lenslets."""
        return None

    @property
    def separation(self) -> float | None:
        """Main lens to lenslets, or to the sensor where there are none [m]; None without a main lens."""
        return None

    @property
    def pupil_distance(self) -> float | None:
        """Distance L' of the exit pupil from the lenslets [m]: `separation`, except behind glass."""
        return self.separation

    @property
    def lenslet_distance(self) -> float | None:
        """Lenslets to sensor, b [m]; None without lenslets."""
        return None

    @property
    def patch(self) -> float | None:
        """Piece of a micro-image that tiles the picture of the focused plane [px]; None if views do."""
        return None

    def layout(self) -> Layout | MicroscopeLayout:
        """Layout for a ray diagram."""
        raise NotImplementedError

    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that sliders can change, at their values."""
        raise NotImplementedError

    def changed(self, values: Mapping[str, Any] | None) -> Self:
        """The same with other values of its `parameters`, by their keys and in their units.

        Raises
        ------
        FormatError
            An unknown key, or a value of another type.
        GeometryError
            Values that no camera can have.
        """
        found = changes(self.parameters(), values, self._count())
        return self.replace(**found) if found else self

    def _count(self) -> tuple[int, int] | None:
        """Number of lenslets (rows, columns); None without them."""
        return None

    def depth_reach(self) -> float:
        """Useful range of depths to either side of the focused plane [m]."""
        raise NotImplementedError

    def point_view(self, dz: float = 0.0) -> PointImage:
        """Image of a point on the axis at a depth `dz` [m] from the focused plane, in some seconds.

        Raises
        ------
        GeometryError
            A depth that the instrument does not image.
        SamplingError
            Planes too large for an answer at once.
        """
        raise NotImplementedError

    def check_accuracy(self, accuracy: float) -> None:
        """Refuse an accuracy that `operator` cannot reach, before any work.

        Raises
        ------
        SamplingError
            A relative rms out of 1e-5 to 1e-2.
        GeometryError
            Of a microscope, out of 1e-5 to 0.1.
        """
        SamplingRules(accuracy)

    def operator_for(
        self,
        calibration: Calibration | None,
        depths: Sequence[float] | None = None,
        samples_per_lenslet: int | None = None,
        progress: Progress | None = None,
    ) -> Linear:
        """Operator of a raw image with that calibration; of the described pixels for kinds without one."""
        raise NotImplementedError

    def would_be(self, share: float) -> str:
        """Change of the description that would explain a lattice `share` times as large as its own."""
        pitch = self.sensor.pixel_pitch
        return f"pixels of {pitch / share * 1e6:.4g} µm instead of {pitch * 1e6:.4g} µm"

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
        return upper_floors.draw("layout", self)

    def describe(self) -> Description:
        """The table of everything that follows from the description, each value with its equation."""
        return upper_floors.describe("describe", self)

    def quantities(self) -> tuple[Row, ...]:
        """All that follows from the description: names, values in SI, units and equations."""
        return self.describe().rows

    def trade_offs(self) -> tuple[Row, ...]:
        """Rows of the `quantities` that change with the magnification, to first order."""
        return upper_floors.describe("trade_offs", self)

    def magnifications(self) -> MagnificationRange:
        """Range of magnifications for the trade-offs."""
        raise NotImplementedError

    @property
    def path_difference(self) -> float:
        """Largest path difference of the light that meets in a point of the image, to first order [m]."""
        raise NotImplementedError

    def at_wavelength(self, wavelength: float) -> Self:
        """The same instrument in light of another wavelength [m]."""
        return self.replace(wavelength=wavelength)

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
