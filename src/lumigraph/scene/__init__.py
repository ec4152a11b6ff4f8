"""Scenes in front of the camera, in object space.

- `volumes`: `Scene` and its parts: `Slice`, `Points`, `Diffuser`
- `targets`: test charts as scenes: pinhole, edge, USAF-1951, gratings, star, chessboard, photo
- `usaf`: the chart USAF-1951; `rgbd`: pictures with depths as opaque slices; `raytraced`: a renderer's scenes
- `sources`: waves: `plane_wave`, `point_source`, `gaussian_beam`
- `schell`, `extended`: partially coherent light as modes: `GaussianSchell`, `ExtendedSource`
- `lamps`: shapes of extended sources
- `medium`: `Medium`, what refracts in a sample before microscopes
- `line`: `SpectralLine`, light of a finite bandwidth
"""

from lumigraph.scene import sources, targets
from lumigraph.scene.extended import ExtendedSource
from lumigraph.scene.line import SpectralLine
from lumigraph.scene.medium import Medium
from lumigraph.scene.raytraced import RaytracedScene, mitsuba
from lumigraph.scene.schell import GaussianSchell
from lumigraph.scene.volumes import Diffuser, Points, Scene, Slice

__all__ = [
    "Diffuser",
    "ExtendedSource",
    "GaussianSchell",
    "Medium",
    "Points",
    "RaytracedScene",
    "Scene",
    "Slice",
    "SpectralLine",
    "mitsuba",
    "sources",
    "targets",
]


def __dir__() -> list[str]:
    return __all__
