"""Slices in light that interferes: one field after another through the camera's train of elements."""

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.field import Field
from lumigraph.elements import Train
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import Propagate, propagate
from lumigraph.scene import Slice
from lumigraph.simulation.camera import ImagedCamera
from lumigraph.simulation.coherence import Coherence, ScenePlane


@dataclass(frozen=True, slots=True)
class Shot:
    """One field on its way: where it enters the camera, and the weight of its intensity."""

    field: Field
    train: Train
    weight: float
    block: int = 0
    """Block of a random or quasi-random sample to which this shot belongs."""

    def arrive(self) -> tuple[int, np.ndarray]:
        """Block of the shot, and its intensity on the samples of the image."""
        *elements, last = self.train.elements or (Train(()),)
        before = Train(elements)(self.field)
        intensity = last.intensity(before) if isinstance(last, Propagate) else last(before).intensity
        return self.block, intensity if self.weight == 1 else self.weight * intensity


def number_of_shots(slices: list[Slice], coherence: Coherence) -> int:
    """Fields that `shots` gives."""
    planes = min(len(slices), 1) if coherence.planes_independent else len(slices)
    return planes * coherence.shots


def shots(camera: ImagedCamera, slices: list[Slice], coherence: Coherence) -> Iterator[Shot]:
    """Shots of slices; independent planes share one propagation, as their interference averages out."""
    train, grid = camera.image_train(), camera.pupil_grid
    planes = [_plane(camera, part) for part in slices]
    # Each slice's own scale goes into its amplitude: its samples may differ in area.
    amplitudes = [plane.amplitude * np.float32(_factor(camera, plane, coherence)) for plane in planes]
    for number, waves in enumerate(coherence.illuminations(planes, camera.wavelength)):
        arriving = []
        for amplitude, light, plane in zip(amplitudes, waves, planes, strict=True):
            with warnings.catch_warnings():
                # The camera's parabolic lenses go with paraxial ways: its error says what both leave out.
                warnings.filterwarnings("ignore", ".*beyond the Fresnel approximation", SamplingWarning)
                if coherence.planes_independent:  # samples of random phase are points: no pitch is too coarse
                    warnings.simplefilter("ignore", SamplingWarning)
                wave = Field(amplitude * light, plane.grid, camera.wavelength)
                arriving.append(propagate(wave, plane.distance, "fresnel", grid=grid))
        block = number * coherence.blocks // coherence.shots
        if coherence.planes_independent:
            together = Field(sum(wave.data for wave in arriving), grid, camera.wavelength)
            yield Shot(together, train, 1.0, block)
        else:
            yield from (Shot(wave, train, 1.0, block) for wave in arriving)


def _plane(camera: ImagedCamera, part: Slice) -> ScenePlane:
    amplitude = np.sqrt(arrays.to_numpy(part.intensity)).astype(np.float32)
    return ScenePlane(amplitude, part.grid, camera.object_distance + part.dz, camera.pupil_diameter)


def _factor(camera: ImagedCamera, plane: ScenePlane, coherence: Coherence) -> float:
    """Factor of a plane's amplitude that makes an even scene of intensity 1 a raw image of mean 1."""
    area = math.prod(plane.grid.pitch)
    scale = coherence.scale(area, camera.wavelength, math.pi * camera.pupil_diameter**2 / 4, plane.distance)
    return math.sqrt(scale) * camera.separation / plane.distance
