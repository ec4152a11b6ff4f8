"""Everything that follows from a camera file, as rows of value, unit and equation.

- `cameras`: single-lens and plenoptic cameras; `lens_glass`, their prescriptions
- `microscope`: light-field microscopes
- `trade_offs`: the same quantities over a range of magnifications
"""

from lumigraph.describe import microscope as _microscope  # noqa: F401 - registers itself
from lumigraph.describe.cameras import describe
from lumigraph.describe.trade_offs import trade_offs

__all__ = ["describe", "trade_offs"]
