"""Main-lens diameters by the micro-images they make: matched, full and touching, defined here only."""

from typing import NamedTuple

from lumigraph.core import checks

ALIKE = 0.01
"""Relative difference of two diameters, or widths, that nobody is told of."""


class Diameters(NamedTuple):
    """Main-lens diameters of one bench [m], by what the words mean.

    Micro-images are D b/L wide and stand p (1 + b/L) apart; they fill D b/(p (L + b)) of that distance.

    ========  ===========  =============================  ================  ==============
    word      D            micro-images                   thesis            ``matching =``
    ========  ===========  =============================  ================  ==============
    matched   p z2/b       as wide as p z2/L: z2/D = b/p  eq. 5.11, 5.15    "views"
    full      p L/b        as wide as a lenslet, p        none              "full"
    touching  p (L + b)/b  as wide as their distance      figures 6.6, 6.7  "touching"
    ========  ===========  =============================  ================  ==============

    In a camera 1.0, L = z2: matched and full are one. A microscope is telecentric, L = ∞: all three are
    `microscope.matched_f_number`.
    """

    matched: float
    full: float
    touching: float


def diameters(pitch: float, image_distance: float, separation: float, lenslet_distance: float) -> Diameters:
    """The three main-lens diameters of a bench [m].

    Parameters
    ----------
    pitch
        Pitch p of the lenslets [m].
    image_distance, separation, lenslet_distance
        Main lens to its image, z2; main lens to lenslets, L; lenslets to sensor, b [m].

    References
    ----------
    Thesis eq. 5.11 and 5.15, where `matched` is called a radius, and figures 6.6 and 6.7. All three: similar
    triangles through the lenslets' centres.

    Examples
    --------
    >>> [round(d * 1e3, 3) for d in diameters(150e-6, 0.12, 0.1356, 7.8e-3)]
    [2.308, 2.608, 2.758]
    """
    p, z2 = checks.positive("pitch", pitch), checks.positive("image_distance", image_distance)
    length, b = (
        checks.positive("separation", separation),
        checks.positive("lenslet_distance", lenslet_distance),
    )
    return Diameters(z2 * p / b, p * length / b, p * (length + b) / b)
