"""A small camera that many tests share: the thesis' 2.0 camera with few and small lenslets."""

from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.units import mm, nm, um

LENSLETS = {"pitch": 100 * um, "focal_length": 5.2 * mm, "count": (4, 4), "magnification": 0.5}


def focused(*, pixel_pitch=6 * um, **lenslets):
    """The camera; of its lenslets, what is said here instead of `LENSLETS`."""
    return FocusedPlenopticCamera(
        wavelength=633 * nm,
        object_distance=120 * mm,
        main_lens={"focal_length": 60 * mm},
        lenslets={**LENSLETS, **lenslets},
        sensor={"pixel_pitch": pixel_pitch},
    )
