"""Pictures made fit for finding a lattice: evenly lit."""

import numpy as np


def flattened(picture: np.ndarray) -> np.ndarray:
    """Picture above its dark level, divided by a smooth quadratic surface: about 1 on average everywhere."""
    ny, nx = picture.shape
    step = max(1, min(ny, nx) // 200)
    sparse = picture[::step, ::step]
    dark = np.float32(np.percentile(sparse, 2))
    y, x = np.linspace(-1, 1, ny, dtype=np.float32), np.linspace(-1, 1, nx, dtype=np.float32)
    surface = Surface(2).fit(y[::step, None], x[None, ::step], sparse - dark)
    return (picture - dark) / surface(y[:, None], x[None, :])


class Surface:
    """Polynomial surface of brightness, kept above a tenth of its top."""

    def __init__(self, degree: int) -> None:
        self.powers = [(a, b) for a in range(degree + 1) for b in range(degree + 1 - a)]
        self.weights: list[np.float32] = []
        self.floor = np.float32(0)

    def fit(self, y: np.ndarray, x: np.ndarray, values: np.ndarray) -> "Surface":
        """Least squares through values at y and x, which broadcast."""
        terms = [np.broadcast_to(y**a * x**b, values.shape).ravel() for a, b in self.powers]
        self.weights = list(np.linalg.lstsq(np.stack(terms, -1), values.ravel(), rcond=None)[0])
        self.weights = [np.float32(w) for w in self.weights]
        self.floor = np.float32(-np.inf)
        self.floor = np.float32(max(0.1 * float(self(y, x).max()), 1e-30))
        return self

    def __call__(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The surface at y and x, which broadcast."""
        total = np.zeros(np.broadcast_shapes(y.shape, x.shape), np.float32)
        for weight, (a, b) in zip(self.weights, self.powers, strict=True):
            total += weight * y**a * x**b
        return np.maximum(total, self.floor)
