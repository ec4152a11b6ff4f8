r"""Objects before a lens of glass, where a thin lens in its exit pupil has the same images of them.

Paraxially a lens of focal length f takes its entrance pupil, at e behind the front principal plane, to its
exit pupil, at e' behind the rear one, m_p = 1 - e'/f times as large. So does a thin lens of focal length
m_p f in the exit pupil, before which objects at (y, x), z before the front principal plane, stand at

.. math:: (y, x, z) \mapsto (m_p y, m_p x, m_p^2 (z + e)).

Light arrives as from the exit pupil, and points of all depths are seen from the entrance pupil. Distortion
moves points besides: to where that thin lens has them where their chief rays arrive.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy


@dataclass(frozen=True, slots=True, eq=False)
class ObjectSpace:
    """Map from places before a lens of glass to those before the thin lens in its exit pupil.

    Parameters
    ----------
    pupil_magnification
        m_p, the exit pupil's width over the entrance pupil's.
    fields
        Tangents before the thin lens in the exit pupil, ascending from 0.
    stretch
        Heights of images over the paraxial ones at the fields (n,), 1 on the axis.
    """

    pupil_magnification: float
    fields: tuple[float, ...]
    stretch: np.ndarray
    _spline: "list[scipy.interpolate.BSpline]" = field(default_factory=list, repr=False)

    def scale(self, y: np.ndarray, x: np.ndarray, distance: float | np.ndarray) -> np.ndarray:
        """Factor of places (y, x) before the glass [m], at a distance of the thin lens [m]."""
        at = self.pupil_magnification * np.hypot(y, x) / distance
        return self.pupil_magnification * self._stretched(np.minimum(at, self.fields[-1]))

    def _stretched(self, at: np.ndarray) -> np.ndarray:
        if not self._spline:
            where, values = np.array(self.fields), np.asarray(self.stretch)
            both = np.concatenate((-where[:0:-1], where)), np.concatenate((values[:0:-1], values))
            self._spline.append(scipy.interpolate.make_interp_spline(*both, k=min(3, len(both[0]) - 1)))
        return self._spline[0](at)

    def depth(self, dz: float | np.ndarray) -> float | np.ndarray:
        """Before the thin lens, of a depth from the focused plane [m]."""
        return self.pupil_magnification**2 * dz
