r"""Images of points before a camera 1.0 as functions of its main lens' phase: those of a microscope.

Without the phase exp(iπw²/(λL)) of the lenslet plane (Talanov's lens transformation) a camera is telecentric:
b becomes b L/(L + b), and the sensor is magnified by 1 + b/L afterwards. So is a microscope, and a plane at z
from the main lens is seen as by an objective of

.. math:: \mathrm{NA} = \frac{D}{2 z}, \quad M = \frac{L}{z}, \quad
          \delta = -z^2 \left(\frac{1}{z} + \frac{1}{L} - \frac{1}{f}\right)

with \delta the depth at which it stands there, 0 where it is in focus.
"""

from collections.abc import Sequence
from dataclasses import replace

from lumigraph.core.calibration import Calibration
from lumigraph.elements.objective import Objective
from lumigraph.errors import GeometryError
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.operators.microscope_building import require_accuracy
from lumigraph.operators.microscope_cell import Lenslet
from lumigraph.operators.microscope_layout import Behind, cell_sampling, laid_out
from lumigraph.operators.microscope_pupil import PupilImages
from lumigraph.operators.paraxial import resolved

POINTS = 1
"""Along a lenslet, of the samples of which a point of 1 is one."""


def pupil_images(
    camera: LensletCamera,
    terms: Sequence[int],
    dz: float,
    accuracy: float,
    pixels: Calibration | None,
) -> PupilImages:
    """See `PlenopticCamera.pupil_images`."""
    require_accuracy(accuracy)
    _require_alike(camera, accuracy)
    z, parts = camera.defocused(dz), camera.lenslets
    L, b = camera.separation, camera.lenslet_distance
    defocus = -(z**2) * (1 / z + 1 / L - 1 / camera.main_lens.focal_length)
    objective = Objective(
        camera.wavelength, camera.pupil_diameter / 2 / z, 1.0, "paraxial",
        aberrations=camera.main_lens.aberrations, image_defocus=defocus,
    )  # fmt: skip
    lenslet = Lenslet(
        parts.pitch, parts.focal_length[0], b * L / (L + b), L / z, parts.pitch * parts.fill_factor,
    )  # fmt: skip
    calibration = camera.calibration if pixels is None else pixels
    behind = Behind(calibration, camera.pixels.fill_factor)
    sampling = cell_sampling(objective, lenslet, behind, POINTS, (0.0,), accuracy)
    sampling = replace(sampling, light=sampling.light * (L / (L + b)) ** 2)
    layout = laid_out(sampling, calibration, parts.pitch * z / L)
    return PupilImages((objective,), lenslet, layout, tuple(terms), accuracy)


def _require_alike(camera: LensletCamera, accuracy: float) -> None:
    """Refuse a camera that is not the same before all lenslets of a square lattice."""
    parts, told = camera.lenslets, "derivatives by the pupil's phase"
    if parts.layout != "square" or parts.rotation:
        raise GeometryError(f"{told} need lenslets in rows and columns along the sensor's.")
    if parts.shape == "round":
        raise GeometryError(f"{told} before a camera need square lenslets.")
    if camera.main_lens.varies:
        raise GeometryError(
            f"{told} need one main lens for all fields. Leave over_field and prescription out."
        )
    if camera.lean is not None or camera.scatter is not None:
        raise GeometryError(
            f"{told} need lenslets that are alike. Leave their tilts and scatter out of [built]."
        )
    if resolved(camera.optics(), accuracy).model == "exact":
        raise GeometryError(f"{told} are paraxial. Use model = 'paraxial'.")
