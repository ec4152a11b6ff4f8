"""Everything that follows from a camera file, as rows of value, unit and equation.

- `cameras`: single-lens and plenoptic cameras; `lens_glass`, their prescriptions
- `microscope`: light-field microscopes
- `trade_offs`: the same quantities over a range of magnifications
"""
