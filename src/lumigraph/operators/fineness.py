"""Sampling and reach that an accuracy of the lenslet-periodic operator needs."""

import math
from dataclasses import dataclass
from typing import Literal

from lumigraph.core import checks
from lumigraph.errors import SamplingError

COARSEST, FINEST = 1e-2, 1e-5
"""Accuracies that can be asked for."""

Edges = Literal["meet", "straight", "other"]
"""Of lenslets: those that meet, and opaque rims, which send light farther aside. Straight ones send it along
two lines, and so farthest."""


@dataclass(frozen=True, slots=True)
class Fineness:
    """Sampling and reach for an accuracy, found on the thesis' cameras against runs with twice as much.

    Parameters
    ----------
    accuracy
        Relative rms error of the raw image.

    Raises
    ------
    SamplingError
        An accuracy out of 1e-2 to 1e-5.
    """

    accuracy: float

    def __post_init__(self) -> None:
        accuracy = checks.finite("accuracy", self.accuracy, "1", SamplingError)
        if not COARSEST >= accuracy >= FINEST:
            raise SamplingError(
                f"accuracy is {accuracy:g} but must lie between {FINEST:g} and {COARSEST:g}, relative rms."
            )

    def samples(self, fresnel_number: float, blur: float, edges: Edges = "meet") -> float:
        """Samples of the image along a lenslet's pitch p.

        Light of the lenslet and of those beside it has frequencies up to some p/(λb); less of it comes from
        farther ones the larger p²/(λb), and more the wider the point's image and behind straight rims. Light
        of the nth neighbour makes fringes of n p²/(λb) to a pitch with the lenslet's own.

        Parameters
        ----------
        fresnel_number
            p²/(λb).
        blur
            Radius of a point's geometric image [p].
        edges
            Of the lenslets.
        """
        farther = 0.0 if edges != "straight" else 1.4 * (1e-3 / self.accuracy) ** 0.15 - 1
        near = (1 + farther * tail(fresnel_number)) * (6 * fresnel_number + 6 + 2 * blur)
        # Slices behind discs are off by 0.75 of 1e-3 so, and were by 1.25 times 1e-2.
        near *= 1 - 0.15 * min(1.0, math.log10(1e-2 / self.accuracy)) if edges == "other" else 1.0
        more = self.neighbours(fresnel_number, blur, edges) - self.neighbours(fresnel_number, 0, edges)
        return near * (1e-3 / self.accuracy) ** 0.2 + 2.3 * fresnel_number * more

    def neighbours(self, fresnel_number: float, blur: float, edges: Edges = "meet") -> int:
        """Lenslets on each side of an image's cell whose light is followed into it.

        More where a point lights more of them: found for images of points with radii of 2 to 6 pitches.
        """
        return math.ceil(self.beside(fresnel_number, blur, edges))

    def beside(self, fresnel_number: float, blur: float, edges: Edges = "meet") -> float:
        """The same, of single lenslets, whose light may be followed to any place [pitches]."""
        pitches = {"meet": 5, "straight": 9, "other": 6}[edges] + _farther(blur)
        return pitches * (1e-3 / self.accuracy) ** 0.23 * tail(fresnel_number)

    @property
    def rank(self) -> float:
        """Part of the kernels' norm that their factors may leave out."""
        return self.accuracy / 6

    def border(self, fresnel_number: float, blur: float) -> float:
        """Lenslets that are missing farther than this from a cell [pitches] are not missed.

        Where points light more of them than the constants were found on, smaller Fresnel numbers send light
        farther, too: a camera 1.0 of 1.9, radius 2.4, was off by 1.08 times 1e-3, now by 0.62.
        """
        aside = math.sqrt(3 / fresnel_number) if blur > 2 else tail(fresnel_number)
        return (4 + _farther(blur)) * (1e-3 / self.accuracy) ** 0.25 * aside

    def corner(self, fresnel_number: float, edges: Edges = "meet") -> float:
        """The same for what is missing on two sides of a corner: farther, each counts by itself.

        Of a cell's distances from both borders [pitches]: their sum behind square lenslets, whose axes are
        apart, else the distance from the corner. What is left out then is 0.2 to 0.7 times the accuracy
        (measured on 13 arrays and fill factors).
        """
        pitches = {"meet": 3.5, "straight": 4.5, "other": 5}[edges]
        return max(1.2, pitches * (1e-3 / self.accuracy) ** 0.3 * tail(fresnel_number))

    @property
    def ring(self) -> float:
        """Distance beyond the array's micro-images to which light is followed [pitches]."""
        return 1.9 * (1e-3 / self.accuracy) ** 0.3

    def near(self, blur: float, airy: float) -> float:
        """Distance, as `reach`, for the light that the lenslets missing beyond the border take away."""
        return blur + 8 * airy * (1e-3 / self.accuracy) ** 0.4

    def reach(self, blur: float, airy: float) -> float:
        """Distance from its geometric image to which a point's light is followed in full.

        Parameters
        ----------
        blur
            Radius of that image.
        airy
            Width λL/D of the diffraction at the main lens, in the same unit as `blur` and the result.
        """
        return blur + 12 * airy * (1e-3 / self.accuracy) ** 0.45


def _farther(blur: float) -> float:
    """Pitches that light is followed farther where points light so many lenslets."""
    return 1.05 * max(0.0, blur - 2)


def tail(fresnel_number: float) -> float:
    """Light that a lenslet's edges send aside, over that of the lenslets that the constants were found on."""
    return min(1.0, math.sqrt(3 / fresnel_number))
