"""How well coefficients are known that were found with beads: by noise, and by how pixels' scores scatter."""

import numpy as np

from lumigraph.adaptive.clusters import Clusters, widened
from lumigraph.adaptive.fit import Fit, Model, solved
from lumigraph.core.calibration import Calibration


def covariance_of(model: Model, fit: Fit) -> np.ndarray:
    """Of all unknowns, by noise; larger where the beads do not explain the raw image."""
    whole = model.around(fit).information / max(model.misfit(fit).pearson, 1.0)
    n = fit.coefficients.size
    whole[-n:, -n:] += model.nodes.information
    return solved(whole, np.eye(len(whole)))


def covariance_of_coefficients(model: Model, fit: Fit) -> np.ndarray:
    """The part (nodes terms, nodes terms) of it [waves² rms]."""
    return covariance_of(model, fit)[-fit.coefficients.size :, -fit.coefficients.size :]


def scattered(model: Model, fit: Fit, calibration: Calibration) -> np.ndarray:
    """The same by how pixels' scores scatter, too, behind lenslets of a calibration; see `clusters`.

    Scores of the coefficients are what pixels add to their slopes while beads move along.
    """
    fit, n, prior = model.known(fit), fit.coefficients.size, model.nodes.information
    whole = model.around(fit).information
    mixed = np.concatenate([-solved(whole[:-n, :-n], whole[:-n, -n:]), np.eye(n)])
    information = mixed.T @ whole @ mixed
    pearson = max(model.misfit(fit).pearson, 1.0)
    scatter = Clusters.of(calibration, n).scatter(model.scores(fit, mixed), pearson * information)
    return widened(information + prior, information / pearson + prior, scatter)
