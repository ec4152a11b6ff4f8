"""Decoded radiance: one picture for each place on the main lens."""

from dataclasses import dataclass
from typing import ClassVar, Self

from lumigraph.core import checks, picture
from lumigraph.core.arrays import A, Array, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.labelled import Labels
from lumigraph.core.noun import Noun
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False)
class LightField(Noun[A]):
    """Radiance L(v, u, t, s): (v, u) on the main-lens aperture, (t, s) on the lenslets.

    Both pairs are coordinates of one frame, so that an object whose image lies at F' = F / α' obeys
    x = α'x' + u(1 - α'): its slope dx/du is 1 - α'.

    Parameters
    ----------
    data
        Radiance (v, u, t, s) or (v, u, t, s, c).
    aperture
        Where the views stand on the main lens [m].
    lenslets
        Where the lenslets stand [m].
    separation
        Main lens to lenslets, F [m].
    valid
        True for samples (v, u, t, s) that rest on good pixels; None where all do. What sums over
        views leaves the others out.

    Raises
    ------
    GeometryError
        The data's or the mask's shape differs from the two grids', or the separation is not above zero.
    """

    axes: ClassVar[str] = "vuts"

    data: A
    aperture: Grid
    lenslets: Grid
    separation: float
    valid: Array | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "separation", checks.positive("separation", self.separation))
        checks.array("data", self.data)
        checks.instance("aperture", self.aperture, Grid)
        checks.instance("lenslets", self.lenslets, Grid)
        shape = tuple(self.data.shape)
        if len(shape) not in (4, 5) or shape[:4] != self.aperture.shape + self.lenslets.shape:
            raise GeometryError(
                f"data has shape {shape} but must be (v, u, t, s[, c]) with (v, u) = {self.aperture.shape} "
                f"of the aperture and (t, s) = {self.lenslets.shape} of the lenslets."
            )
        if self.valid is not None:
            checks.array("valid", self.valid)
            if tuple(self.valid.shape) != shape[:4]:
                raise GeometryError(
                    f"valid has shape {tuple(self.valid.shape)} but the data has {shape[:4]} samples "
                    "(v, u, t, s). Give one true or false for each."
                )

    def view(self, v: int, u: int) -> A:
        """Picture (t, s[, c]) seen from one place on the main lens; indices as in NumPy."""
        return self.data[v, u, ...]

    def micro_image(self, t: int, s: int) -> A:
        """Directions (v, u[, c]) that meet in one lenslet."""
        return self.data[:, :, t, s, ...]

    def epi(self, v: int, t: int) -> A:
        """Epipolar-plane image (u, s[, c]): one row of lenslets seen from one row of the aperture."""
        return self.data[v, :, t, ...]

    def _repr_html_(self) -> str:
        nv, nu, nt, ns = self.data.shape[:4]
        rows = [
            ("views (v, u)", f"{nv} × {nu}, {picture.length(self.aperture.pitch[1])} apart"),
            ("samples (t, s)", f"{nt} × {ns}, {picture.length(self.lenslets.pitch[1])} apart"),
            ("separation", picture.length(self.separation)), ("numbers", picture.numbers(self.data)),
        ]  # fmt: skip
        middle = picture.thumbnail(self.view(nv // 2, nu // 2))
        return picture.card("Light field", rows, middle, "The middle view")

    def _labels(self) -> Labels:
        labels = Labels("vuts", "radiance", attributes={"separation": self.separation})
        if self.valid is not None:
            labels.along["valid"], labels.units["valid"] = (tuple("vuts"), to_numpy(self.valid)), ""
        return labels.stands_on(self.aperture, "vu").stands_on(self.lenslets, "ts")

    @classmethod
    def _of_labels(cls, labels: Labels) -> Self:
        grids = labels.grid("vu"), labels.grid("ts")
        return cls(labels.data, *grids, labels.number("separation"), labels.along.get("valid"))
