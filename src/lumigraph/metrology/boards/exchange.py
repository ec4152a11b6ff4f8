"""Cameras with lengths in files of other programs: COMPOTE's intrinsics and LFToolbox' CalInfo."""

import json
import os

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.errors import FormatError
from lumigraph.io import source
from lumigraph.metrology.boards import compote, lftoolbox
from lumigraph.metrology.boards.camera import MetricCamera
from lumigraph.metrology.boards.files import read_json, reading
from lumigraph.store import write_bytes

FORMATS = ("compote", "lftoolbox")
"""Formats that `save_camera` writes."""


def load_camera(
    path: str | os.PathLike[str], *, pixel_pitch: float | None = None, view_pitch: float | None = None
) -> tuple[MetricCamera, Calibration]:
    """Camera and micro-images in a file of COMPOTE (intrinsics.json) or LFToolbox (CalInfo.json).

    Parameters
    ----------
    path
        The file; what it holds says whose it is.
    pixel_pitch
        Of the sensor [m], where LFToolbox' file does not say.
    view_pitch
        Of LFToolbox' views [px of the raw image]; the micro-images' pitch over the views if left out.

    Returns
    -------
    tuple[MetricCamera, Calibration]
        The latter's ``notes`` say what the file does not hold, or what a `MetricCamera` cannot.

    Raises
    ------
    FormatError
        Another file, one that is damaged, or that of no camera.
    """
    file = source.regular_file(path)
    found = read_json(file)
    with reading(file):
        if compote.is_intrinsics(found):
            return compote.camera_of(found)
        if lftoolbox.is_info(found):
            return lftoolbox.camera_of(found, pixel_pitch, view_pitch)
    raise FormatError(
        f"{file} is neither COMPOTE's intrinsics nor LFToolbox' CalInfo: it has the keys "
        f"{', '.join(sorted(found))[:80]}. What `lumigraph board` wrote is read by lumigraph.metrology.load."
    )


def save_camera(
    camera: MetricCamera,
    calibration: Calibration,
    path: str | os.PathLike[str],
    form: str,
    *,
    distance: float | None = None,
    f_number: float | None = None,
    directions: int | None = None,
) -> tuple[str, ...]:
    """Write a camera for COMPOTE or LFToolbox; returns what the file leaves out, one sentence each.

    Parameters
    ----------
    camera, calibration
        Lengths, and the micro-images that belong to them.
    path
        File (.json).
    form
        One of `FORMATS`.
    distance
        Of COMPOTE's: where distortion is the same [m]; the plane whose image is in the lenslets if left out.
    f_number
        Of COMPOTE's main lens.
    directions
        Views along each axis of LFToolbox' light fields.

    Raises
    ------
    FormatError
        A camera that the format cannot hold, another form, or no views.
    """
    checks.choice("form", form, FORMATS, FormatError)
    if form == "compote":
        plain, notes = compote.intrinsics_of(camera, calibration, distance=distance, f_number=f_number)
    elif directions is None:
        raise FormatError(
            "LFToolbox' matrix belongs to light fields of so many views along an axis. Give directions=9."
        )
    else:
        plain, notes = lftoolbox.info_of(camera, calibration, directions)
    write_bytes(path, json.dumps(plain, indent=1).encode())
    return notes
