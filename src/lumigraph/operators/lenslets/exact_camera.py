"""An exact camera before points: light in the lenslet plane is a sum over directions (`exact_light`).

The stop's phase, strength and edge are smooth in them: from one camera to another close by they change by few
numbers.
"""

from functools import cached_property
from typing import Any

import numpy as np

from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.array_libraries import Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.exact_lenslets import between, interpolated
from lumigraph.operators.lenslets.exact_light import ObliqueLight
from lumigraph.operators.lenslets.illuminated import share
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.band import HALF_WIDTH

SMOOTH = 24
"""Numbers along an axis of directions that changes of the stop's phase and strength follow from."""


class ExactSampledCamera(SampledCamera):
    """An exact camera with lenslets before points."""

    def numbers(self, source: SourcePoint) -> dict[str, Any]:
        """Numbers that a point's light follows from: of places, directions, the stop and its edge."""
        light = self._oblique(source)
        nodes, _ = interpolated(SMOOTH)
        y, x = ((d[-1] + d[0]) / 2 + (d[-1] - d[0]) / 2 * nodes for d in light.directions)
        over = light.over(y[:, None], x)
        brighter = np.log(share(self._at(source.dz))) / 2
        smooth = np.stack([over.phase, over.strength + brighter, *over.bends])
        k, places = 2 * np.pi / light.camera.wavelength, self.lenslets.places(*source.lit.cells)
        down, across = (k * (at - to) for at, to in zip(places, light.place, strict=True))
        above, beside = light.directions
        edge = self._edge(light.over(above[:, None], beside).within)
        return {"y": down, "above": above, "x": across, "beside": beside, "smooth": smooth, "edge": edge}

    def light(self, xp: ArrayLibrary, numbers: Numbers, source: SourcePoint) -> Array:
        """Light (y, x) of a point in the lenslet plane, without the sphere around the stop's middle."""
        phase, strength, bends, smooth = map(xp.asarray, self._stop(source))
        to = self._smooth
        change = xp.asarray(to) @ (numbers["smooth"] - smooth) @ xp.asarray(to.T)
        stop = numbers["edge"] * xp.exp((strength + change[1]) + 1j * (phase + change[0]))
        y, x = numbers["y"][:, None], numbers["x"]
        left = xp.exp(1j * (y * numbers["above"]))
        right = xp.exp(1j * (numbers["beside"][:, None] * x))
        parts = [
            left @ (one @ right) for one in (stop, *(stop * (bends[k] + change[2 + k]) for k in range(3)))
        ]
        return parts[0] + 0.5j * (y**2 * parts[1] + 2 * y * x * parts[2] + x**2 * parts[3])

    def _stop(self, source: SourcePoint) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Phase, logarithm of the strength and bends in all directions, and their numbers, of the camera."""
        key = (source.number, *source.position.tolist())
        if key not in self._stops:
            if len(self._stops) > 8:
                self._stops.clear()
            light = self._oblique(source)
            y, x = light.directions
            over = light.over(y[:, None], x)
            brighter = np.log(share(self._at(source.dz))) / 2
            smooth = self.numbers(source)["smooth"]
            self._stops[key] = over.phase, over.strength + brighter, over.bends, smooth
        return self._stops[key]

    @cached_property
    def _stops(self) -> dict[Any, Any]:
        return {}

    def _oblique(self, source: SourcePoint) -> ObliqueLight:
        optics = self._at(source.dz)
        y, x = self._place(optics, source.position).tolist()
        lens = _cells.lens(optics.camera)
        return ObliqueLight(optics.camera, lens, optics.distance, self.nodes, (y, x), HALF_WIDTH + 1)

    def _edge(self, within: np.ndarray) -> np.ndarray:
        """Part of the amplitude that the stop lets through, by how far directions are inside its edge."""
        return main_lens.smooth_edge(self.nodes / 2, 0.5 - within)

    @cached_property
    def _smooth(self) -> np.ndarray:
        """Matrix from numbers at the nodes to all directions of an axis, which stand evenly."""
        return between(np.linspace(-1, 1, self.nodes + 2 * (HALF_WIDTH + 1)), SMOOTH)
