"""The kind of camera that took a raw image."""

from dataclasses import dataclass
from typing import Literal

from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.instruments import Instrument
from lumigraph.instruments.capabilities import Decoded, Rendered, WithObjective
from lumigraph.rendering.kind_check import focused_shift

Kind = Literal["views", "plenoptic 1.0", "plenoptic 2.0", "multi-focus plenoptic 2.0", "microscope"]


@dataclass(frozen=True, slots=True)
class Guess:
    """Something that was found out, and why.

    Parameters
    ----------
    what
        "kind", "lattice", ...
    value
        What was found.
    reason
        Why.

    Examples
    --------
    >>> str(Guess("kind", "plenoptic 1.0", "neighbouring micro-images share no sharp details"))
    'kind: plenoptic 1.0, since neighbouring micro-images share no sharp details'
    """

    what: str
    value: str
    reason: str

    def __str__(self) -> str:
        return f"{self.what}: {self.value}, since {self.reason}"


def recognise(
    raw: RawImage, calibration: Calibration, camera: Instrument | None = None
) -> tuple[Kind, Guess]:
    """Kind of the camera, by its description, by its lattice, or by what micro-images show.

    A microscope without a description is taken for a camera 1.0: their raw images look alike.

    Raises
    ------
    CalibrationError
        A camera without lenslets.
    """
    if camera is not None:
        kind = _described(camera, calibration)
        return kind, Guess("kind", kind, f"the camera file describes a {camera.noun}")
    kinds = calibration.lattice.kinds
    if kinds > 1:
        return "multi-focus plenoptic 2.0", Guess(
            "kind", "multi-focus plenoptic 2.0", f"the lattice has {kinds} kinds of lenslets"
        )
    shift = focused_shift(raw.data, calibration)
    if shift is not None:
        return "plenoptic 2.0", Guess(
            "kind", "plenoptic 2.0",
            f"neighbouring micro-images show the same sharp details, {abs(shift):.1f} px apart",
        )  # fmt: skip
    return "plenoptic 1.0", Guess(
        "kind", "plenoptic 1.0",
        "neighbouring micro-images share no sharp details. Is it a microscope's? Then give --camera FILE or "
        "NAME ('lumigraph catalogue' lists them) for a volume",
    )  # fmt: skip


def _described(camera: Instrument, calibration: Calibration) -> Kind:
    if isinstance(camera, WithObjective):
        return "microscope"
    if isinstance(camera, Rendered):
        return "multi-focus plenoptic 2.0" if calibration.lattice.kinds > 1 else "plenoptic 2.0"
    if isinstance(camera, Decoded):
        return "plenoptic 1.0"
    raise CalibrationError(f"a {camera.noun} camera has no lenslets. Use 'lumigraph deconvolve'.")
