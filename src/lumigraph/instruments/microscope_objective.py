"""The objective of a microscope: a table of its camera file."""

from typing import Literal, Self

from pydantic import Field, model_validator

from lumigraph.design import microscope as closed_forms
from lumigraph.errors import GeometryError
from lumigraph.instruments.part import Part
from lumigraph.instruments.quantities import Aberrations, Fraction, Length, Positive


class MicroscopeObjective(Part):
    """Table ``[objective]``.

    Parameters
    ----------
    magnification
        Engraved magnification.
    numerical_aperture, immersion_index
        NA and n.
    maker
        Whose tube lens the engraved magnification is for, such as "Nikon": `design.microscope.TUBE_LENSES`.
    tube_lens
        Focal length of the tube lens in use; with a maker it changes the magnification.
    model
        "scalar", "vector", "paraxial" or "rays" (for images traced by rays); left out, vector from NA 0.8 on.
    axial_share
        Axial share of dipoles, with "vector"; 1/3 for all directions.
    aberrations
        Zernike terms: Noll index to waves rms.
    sample_index, focus_depth
        Index of the medium around the object, and depth of the focused plane in it; left out, the immersion.
    """

    magnification: Positive
    numerical_aperture: Positive
    immersion_index: Positive = 1.0
    maker: str | None = None
    tube_lens: Length | None = None
    model: Literal["scalar", "vector", "paraxial", "rays"] | None = None
    axial_share: Fraction = 1 / 3
    aberrations: Aberrations = Field(default_factory=dict)
    sample_index: Positive | None = None
    focus_depth: Length | None = None

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        closed_forms.sine(self.numerical_aperture, self.immersion_index)
        if self.maker is not None:
            closed_forms.tube_lens(self.maker)
        if self.focus_depth is not None and self.sample_index is None:
            raise GeometryError("focus_depth says how deep in the sample; give sample_index too.")
        return self

    @property
    def tube_focal_length(self) -> float | None:
        """Focal length of the tube lens, by default the maker's [m]; None if neither is given."""
        return self.tube_lens or (None if self.maker is None else closed_forms.tube_lens(self.maker))

    @property
    def actual_magnification(self) -> float:
        """Magnification to the native image: the engraved one, times the tube lens over the maker's."""
        if self.maker is None or self.tube_lens is None:
            return self.magnification
        return self.magnification * self.tube_lens / closed_forms.tube_lens(self.maker)
