"""Free-space propagation of a `Field` over a distance.

- `propagate`: `propagate()`, the element `Propagate`, `METHODS`, to which `register()` adds, and
  `choose_method()`, which says why
- `angular_spectrum`: plain, band-limited, or within a pass band of one's own
- `fresnel`: one step onto its own or a given grid
- `halves`: the paraxial kernel onto other points by even and odd halves, on NumPy arrays
- `zoom`: angular spectrum onto any grid, by matrix DFT or chirp-z
- `sampling`: validity ranges and sampling rules, in closed form
- `dropped`: what a band limit's dropped frequencies would have brought
- `plausible`: light that left the window, waves too steep for their samples or for Fresnel's approximation
- `window`: the window of a calculation: size, quick FFT sizes, memory
- `pruned`: convolution without the transforms of zeros
- `cache`: transfer functions that were built before
"""

from lumigraph.propagation.propagate import METHODS, Choice, Propagate, choose_method, propagate, register

__all__ = ["METHODS", "Choice", "Propagate", "choose_method", "propagate", "register"]


def __dir__() -> list[str]:
    return __all__
