"""Abilities of some kinds of instruments, as protocols: ``isinstance(camera, Decoded)``."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.elements.objective import Objective
from lumigraph.instruments.parts import MainLens
from lumigraph.operators.microscope.pupil import PupilImages


@runtime_checkable
class Decoded(Protocol):
    """Instruments whose raw images are decoded into views, which are refocused by a factor."""

    def refocus_factor(self, dz: float, separation: float) -> float:
        """α' that focuses views of a separation [m] at a depth `dz` [m] from the focused plane."""
        ...


@runtime_checkable
class Correctable(Protocol):
    """Instruments whose bias of depth can be measured on planes of known depth."""

    def plane_views(self, alpha: float) -> LightField:
        """Views of a textured plane at a refocus factor."""
        ...


@runtime_checkable
class WithPupil(Protocol):
    """Instruments whose images of points are functions of the pupil's phase."""

    @property
    def configuration(self) -> str:
        """Position of the lenslets: "1.0", "2.0" or "fourier"."""
        ...

    def pupil_images(self, terms: Sequence[int]) -> PupilImages:
        """Images of points, with derivatives by Zernike terms."""
        ...


@runtime_checkable
class Rendered(Protocol):
    """Instruments whose raw images are rendered from a patch of each micro-image."""

    def patch_at(self, dz: float, frequency: float | None = None) -> float:
        """Patch [px] that tiles the picture at a depth `dz` [m], by rays or of a frequency [1/m]."""
        ...

    def patches_on_raw(self) -> tuple[float, ...]:
        """Patch [px] at which each kind of lenslets is sharp, in the order of the calibration."""
        ...


@runtime_checkable
class WithLenslets(Protocol):
    """Instruments whose object is sampled by lenslets."""

    @property
    def lenslet_size(self) -> float:
        """Size of a lenslet in the focused plane [m]."""
        ...


@runtime_checkable
class WithMainLens(Protocol):
    """Instruments with a main lens: depths follow from the lens equation."""

    main_lens: MainLens
    object_distance: float

    def alpha(self, dz: float) -> float:
        """Refocus factor of a depth `dz` [m] from the focused plane."""
        ...


@runtime_checkable
class WithDepth(Protocol):
    """Instruments whose disparities become depths by the lens equation."""

    main_lens: MainLens

    def in_metres(self, found: DepthMap, source: LightField | Calibration) -> DepthMap:
        """Depth of each place from the focused plane [m]."""
        ...

    def object_to_pupil(self) -> float:
        """Distance from the focused plane to the entrance pupil [m]."""
        ...


@runtime_checkable
class WithObjective(Protocol):
    """Instruments with an objective: depths are small and proportional to the refocus factor."""

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """The objective at each wavelength."""
        ...

    @property
    def in_pupil(self) -> bool:
        """True if lenslets stand in the pupil, so that each micro-image is a view."""
        ...

    def depth_per_alpha(self, separation: float) -> float:
        """Depth from the focused plane [m] over α' - 1, of views with a separation [m]."""
        ...

    def low_pass_distances(self, depths: Sequence[float]) -> tuple[float, ...]:
        """Widths [m] of a low-pass that keeps lenslet-shaped artefacts out of each depth [m]."""
        ...
