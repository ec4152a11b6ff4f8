"""`Exposure`: a sensor's noise by reparametrisation, so that slopes go through it."""

import torch

from lumigraph.core import checks
from lumigraph.sensor import Sensor


class Exposure(torch.nn.Module):
    r"""Electrons of raw images, with noise that is differentiable.

    Photon noise is drawn as Gaussian of the mean's variance, exact in its first two moments,

    .. math:: e = \mu + \sqrt{\mu + \sigma^2}\, \epsilon, \quad \mu = \eta n I + i t

    with read noise and rounding σ and one standard normal ε a pixel, which does not depend on the camera.

    Parameters
    ----------
    sensor
        Quantum efficiency, dark current, read noise and gain.
    photons
        Photons that an intensity of 1 sends to a pixel, n.
    """

    def __init__(self, sensor: Sensor, photons: float) -> None:
        super().__init__()
        self.sensor, self.photons = sensor, checks.positive("photons", photons, "1")

    def mean(self, intensity: torch.Tensor) -> torch.Tensor:
        """Mean electrons."""
        light = self.sensor.quantum_efficiency * self.photons * intensity
        return light.clamp(min=0) + self.sensor.dark_signal

    def forward(self, intensity: torch.Tensor, generator: torch.Generator | None = None) -> torch.Tensor:
        """Electrons, drawn; the same generator and seed draw the same."""
        mean, sensor = self.mean(intensity), self.sensor
        noise = (mean + sensor.read_noise**2 + sensor.gain**2 / 12) ** 0.5
        drawn = torch.randn(mean.shape, dtype=mean.dtype, device=mean.device, generator=generator)
        return mean + noise * drawn
