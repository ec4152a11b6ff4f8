"""The lenslet-periodic operator: incoherent planes before a lenslet array, and the adjoint.

- `incoherent`: `periodic_operator`; `kernels`, its matrices; `blocks`, `factors`, how they are made
- `border_correction`, `mirrors`, `shared_blocks`, `streamed`, `sizes`: cells at the border, symmetry, memory
- `over_field`: exact operators, interpolated over the field
- `glare`, `far_field`: light far from a point's image
- `white`: the evenly lit main lens; `coherent`, planes in coherent light
- `screens`, `partial_occlusion`: opaque screens, and planes that they hide in part
"""
