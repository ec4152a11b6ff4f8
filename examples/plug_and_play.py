"""A volume of a light-field microscope by deepinv's plug-and-play, beside Richardson and Lucy's method.

``pip install 'lumigraph[deepinv]'``, then ``python examples/plug_and_play.py``. Prints correlation with the
truth and CPU seconds of each.
"""

import time

import numpy as np
import torch

import lumigraph as lg
from lumigraph.deconvolution import RichardsonLucy, filters


def correlation(found: np.ndarray, truth: np.ndarray) -> float:
    """Of two volumes on the same samples."""
    return float(np.corrcoef(found.ravel(), truth.ravel())[0, 1])


def plug_and_play(operator: lg.core.linear.Linear, raw: np.ndarray, iterations: int = 20) -> np.ndarray:
    """Volume by gradient steps and a total-variation denoiser of each plane."""
    from deepinv.models import TVDenoiser
    from deepinv.optim import PGD
    from deepinv.optim.data_fidelity import L2
    from deepinv.optim.prior import PnP

    physics = lg.torch.physics(operator)
    y = torch.as_tensor(raw, dtype=torch.float32)[None, None]
    first = physics.A_adjoint(y)
    size = float(physics.compute_sqnorm(first, max_iter=10, verbose=False))

    class Planes(torch.nn.Module):
        """The denoiser, plane by plane; light is not negative."""

        def __init__(self) -> None:
            super().__init__()
            self.each = TVDenoiser(n_it_max=20)

        def forward(self, x: torch.Tensor, sigma: float) -> torch.Tensor:
            planes = x[0].movedim(1, 0)
            return self.each(planes, sigma).movedim(0, 1)[None].clamp(min=0)

    model = PGD(
        data_fidelity=L2(), prior=PnP(Planes()), stepsize=1 / size, max_iter=iterations,
        sigma_denoiser=0.01 * float(first.max()) / size, custom_init=lambda y, physics: first / size,
    )  # fmt: skip
    with torch.no_grad():
        return model(y, physics)[0, 0].numpy()


def main() -> None:
    sample = lg.samples.volume()
    depths = sample.volume.depths
    operator = sample.camera.operator(depths, sample.samples_per_lenslet, accuracy=1e-2)
    truth = np.asarray(sample.volume.data)
    raw = np.asarray(sample.raw.data, np.float64)
    widths = filters.widths_of(sample.camera.low_pass_distances(depths), operator.object_grid.pitch[0])
    ways = {
        "Richardson-Lucy, 20": lambda: lg.deconvolve(sample.raw, operator, 20),
        "with a low-pass, 20": lambda: lg.deconvolve(
            sample.raw, operator, 20, method=RichardsonLucy(filter=filters.LowPass(widths))
        ),
        "plug-and-play, 20": lambda: plug_and_play(operator, raw),
    }
    for name, run in ways.items():
        began = time.process_time()
        found = run()
        data = np.asarray(getattr(found, "data", found))
        print(f"{name}: correlation {correlation(data, truth):.3f}, {time.process_time() - began:.1f} CPU s")


if __name__ == "__main__":
    main()
