"""Derivatives of the error of reconstructed scenes by a microscope's parts, beside central differences."""

from dataclasses import replace

import numpy as np
import pytest
from tests.studies.information.test_microscope_slopes import UM, scope
from tests.studies.information.test_reconstruction_slopes import Matrix

import lumigraph as lg
from lumigraph.operators.lenslets.part_volume import PartVolume
from lumigraph.operators.microscope.pupil_plane import PupilPlane
from lumigraph.studies.information import Light, Scenes, imaging, reconstruction_slopes
from lumigraph.studies.information.reconstruction import probed
from lumigraph.studies.information.reconstruction_slopes import sloped

LIGHT, DEPTHS = Light(2000), (-9 * UM, 6 * UM)


def in_image(focal_length=2.52e-3, pixel=6.5 * UM, aperture=0.2):
    """Three lenslets wide; not where their light is sampled more finely from one to the next."""
    lenslets = {"focal_length": focal_length}
    return scope(aperture=aperture, pixel=pixel, lenslets=lenslets).replace(sensor={"shape": (52, 52)})


def in_pupil(fourier_lens=0.075, pixel=43 * UM, aperture=0.5):
    """Few pixels."""
    return lg.load_camera("lfm-fourier").replace(
        fourier_lens=fourier_lens, objective={"numerical_aperture": aperture},
        sensor={"pixel_pitch": pixel, "shape": (87, 88)},
    )  # fmt: skip


def exact(part: PartVolume) -> PartVolume:
    """In double precision."""
    planes = (
        replace(one, images=replace(one.images, double=True)) if isinstance(one, PupilPlane) else one
        for one in part.planes
    )
    return replace(part, planes=tuple(planes))


def seen_by(one, known, scenes, pairs=()):
    """Raw images by the microscope's `part_volume` of samples where they are known, and the planes."""
    grid, planes = known.operator.object_grid, len(DEPTHS)
    part = exact(one.part_volume(list(pairs), grid, DEPTHS))
    each = np.eye(grid.shape[0] * grid.shape[1]).reshape(-1, *grid.shape)
    operator = Matrix(
        object_grid=grid, depths=DEPTHS, of=np.concatenate([plane.forward(each) for plane in part.planes])
    )
    light = imaging.electrons(one, np.array(DEPTHS), scenes, LIGHT)
    mean = imaging._forward(operator, known.across, light, np.ones((planes, 8, 8))) + one.sensor.dark_signal
    noise = np.sqrt(mean + imaging.reading(one.sensor) ** 2)
    return replace(known, operator=operator, light=light, mean=mean, noise=noise), part


@pytest.mark.long
@pytest.mark.parametrize(
    ("of", "scenes", "key", "value", "step"),
    [
        (in_image, Scenes(1.8 * UM, 8), "focal_length", 2.52e-3, 1e-3),
        (in_image, Scenes(1.8 * UM, 8), "pixel", 6.5 * UM, 1e-3),
        (in_pupil, Scenes(14 * UM, 8), "fourier_lens", 0.075, 1e-5),
        (in_pupil, Scenes(14 * UM, 8), "pixel", 43 * UM, 1e-5),
    ],
)
def test_slopes_are_central_differences_of_the_same_estimate(of, scenes, key, value, step, monkeypatch):
    """Of a volume whose samples stay where they are; raw images are rounded to single precision."""
    monkeypatch.setattr(imaging, "ENOUGH", 1e-10)
    ends = {h: [of(**{key: value * (1 + s * h)}) for s in (-1, 1)] for h in (1e-6, step)}
    known = imaging.imaging(of(), np.array(DEPTHS), scenes, LIGHT, 1e-2)
    seen, part = seen_by(of(), known, scenes, [tuple(ends[1e-6])])
    low, high = (imaging.electrons(end, np.array(DEPTHS), scenes, LIGHT) for end in ends[1e-6])
    slope = sloped(seen, part, probed(seen, 8).found, (high - low)[None])[0]
    low, high = (probed(seen_by(end, known, scenes)[0], 8).left.sum() for end in ends[step])
    assert step / 1e-6 * slope == pytest.approx(high - low, rel=2e-3, abs=0)


@pytest.mark.parametrize("of", [pytest.param(in_image, marks=pytest.mark.long), in_pupil])
def test_slopes_are_told_with_the_error(of):
    scenes, pair = Scenes((1.8 if of is in_image else 14) * UM, 8), (of(aperture=0.2), of(aperture=0.21))
    found = reconstruction_slopes(of(aperture=0.205), [pair], DEPTHS, scenes, LIGHT, volume=True)
    alone = lg.information.reconstruction_error(of(aperture=0.205), DEPTHS, scenes, LIGHT, volume=True)
    assert found.bound == pytest.approx(alone.value, rel=1e-6)
    assert found.changes[0] < 0  # more light, and finer
