"""Protocols of the instruments that a simulation accepts."""

from typing import Protocol, runtime_checkable

from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.elements import Train
from lumigraph.operators import CameraOptics
from lumigraph.sensor import Sensor


@runtime_checkable
class Imaging(Protocol):
    """Protocol of an instrument whose elements lead light to a sensor."""

    def image_train(self) -> Train:
        """Elements from the field just before the main lens to the sensor."""
        ...


class Camera(Imaging, Protocol):
    """Protocol of a camera that `simulate` accepts; members of lenslets are None without them."""

    def optics(self) -> CameraOptics:
        """Plain values of the camera, which operators read."""
        ...

    @property
    def wavelength(self) -> float:
        """Wavelength in vacuum [m]."""
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
        """Diameter of the main lens' stop [m]."""
        ...

    @property
    def lattice(self) -> Lattice | None:
        """Lattice of the lenslets [m]; None without lenslets."""
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
        """Elements from the field just before the lenslets to the sensor."""
        ...
