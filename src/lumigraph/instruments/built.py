"""Where the parts of a camera stand as built, table ``[built]``, if not where its description puts them."""

from pydantic import model_validator

from lumigraph.elements import Scatter
from lumigraph.instruments.part import Part
from lumigraph.instruments.quantities import Displacement, Length, NotNegative, Seed


class Built(Part):
    """A camera as it was built: distances, where they are not the description's, and lenslets that differ.

    The object stays at `object_distance`, in focus or not.

    Parameters
    ----------
    separation
        Main lens to lenslets, L.
    lenslet_distance
        Lenslets to sensor, b.
    focal_length_scatter
        Standard deviation of single lenslets' focal lengths, as a part of them.
    decentre_scatter
        Standard deviation of their vertices from the middle of their apertures, along each axis.
    missing
        Part of the lenslets that are opaque.
    seed
        Of which lenslet is how.

    Examples
    --------
    >>> Built(separation="135.7 mm").separation
    0.1357
    """

    separation: Length | None = None
    lenslet_distance: Length | None = None
    focal_length_scatter: NotNegative = 0.0
    decentre_scatter: Displacement = 0.0
    missing: NotNegative = 0.0
    seed: Seed = 0

    @property
    def scatter(self) -> Scatter | None:
        """How single lenslets differ; None where they are alike.

        Raises
        ------
        GeometryError
            A negative scatter, or more than lenslets have.
        """
        found = Scatter(self.focal_length_scatter, self.decentre_scatter, self.missing, self.seed)
        return None if found == Scatter(seed=self.seed) else found

    @model_validator(mode="after")
    def _is_possible(self) -> "Built":
        _ = self.scatter  # it refuses what cannot be
        return self

    def __bool__(self) -> bool:
        return self != Built()
