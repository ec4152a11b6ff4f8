"""Where the parts of a camera stand as built, table ``[built]``, if not where its description puts them."""

from lumigraph.instruments.parts import Part
from lumigraph.instruments.quantities import Length


class Built(Part):
    """Distances of a camera as it was built; those left out are the description's.

    The object stays at `object_distance`, in focus or not.

    Parameters
    ----------
    separation
        Main lens to lenslets, L.
    lenslet_distance
        Lenslets to sensor, b.

    Examples
    --------
    >>> Built(separation="135.7 mm").separation
    0.1357
    """

    separation: Length | None = None
    lenslet_distance: Length | None = None

    def __bool__(self) -> bool:
        return self != Built()
