"""Small cameras that many tests share: the thesis' 2.0 camera with few and small lenslets, and a 1.0."""

from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
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


def plenoptic():
    """A camera 1.0 of few lenslets at f/90."""
    return PlenopticCamera(
        wavelength=633 * nm,
        object_distance=240 * mm,
        main_lens={"focal_length": 120 * mm},
        lenslets={"pitch": 110 * um, "focal_length": 10 * mm, "count": (9, 9)},
        sensor={"pixel_pitch": 9 * um},
    )
