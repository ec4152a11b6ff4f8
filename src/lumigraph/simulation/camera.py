"""What a simulation asks of an instrument."""

from typing import Protocol, runtime_checkable

from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.elements import Train
from lumigraph.operators import CameraOptics
from lumigraph.sensor import Sensor


@runtime_checkable
class Imaging(Protocol):
    """Anything with elements that light goes through to a sensor."""

    def image_train(self) -> Train:
        """From the field just before the main lens to the sensor."""
        ...


class Camera(Imaging, Protocol):
    """An instrument, as `simulate` sees it; what belongs to lenslets is None without them."""

    def optics(self) -> CameraOptics:
        """What operators read of it."""
        ...

    @property
    def wavelength(self) -> float:
        """In vacuum [m]."""
        ...

    @property
    def object_distance(self) -> float:
        """Focused plane to main lens, z1 [m]."""
        ...

    @property
    def separation(self) -> float:
        """Main lens to lenslets, or to the sensor where there are none [m]."""
        ...

    @property
    def lenslet_distance(self) -> float | None:
        """Lenslets to sensor, b [m]."""
        ...

    @property
    def pupil_diameter(self) -> float:
        """Of the main lens [m]."""
        ...

    @property
    def lattice(self) -> Lattice | None:
        """Where the lenslets stand [m]."""
        ...

    @property
    def object_grid(self) -> Grid:
        """Samples of the focused plane."""
        ...

    @property
    def pupil_grid(self) -> Grid:
        """Samples of the main lens."""
        ...

    @property
    def lenslet_grid(self) -> Grid | None:
        """Samples of the lenslet plane."""
        ...

    @property
    def image_grid(self) -> Grid:
        """Samples of the sensor plane."""
        ...

    @property
    def sensor(self) -> Sensor:
        """Pixels."""
        ...

    def lens_train(self) -> Train:
        """The main lens: phase, stop and aberrations."""
        ...

    def relay_train(self) -> Train | None:
        """From the field just before the lenslets to the sensor."""
        ...
