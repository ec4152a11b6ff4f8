"""Uncertainty of coefficients that were found with beads: by noise, and by the scatter of pixels' scores."""

import numpy as np

from lumigraph.adaptive.clusters import Clusters, widened
from lumigraph.adaptive.fit import Fit, Model, solved
from lumigraph.core.calibration import Calibration


def covariance_of(model: Model, fit: Fit) -> np.ndarray:
    """Covariance of all unknowns, by noise; larger where the beads do not explain the raw image."""
    whole = model.around(fit).information / max(model.misfit(fit).pearson, 1.0)
    n = fit.coefficients.size
    whole[-n:, -n:] += model.nodes.information
    return solved(whole, np.eye(len(whole)))


def covariance_of_coefficients(model: Model, fit: Fit) -> np.ndarray:
    """Covariance (nodes terms, nodes terms) of the coefficients [waves² rms]."""
    return covariance_of(model, fit)[-fit.coefficients.size :, -fit.coefficients.size :]


def scattered(model: Model, fit: Fit, calibration: Calibration) -> np.ndarray:
    """Covariance of the coefficients by the scatter of pixels' scores, too, behind lenslets; see `clusters`.

    Scores of the coefficients are what pixels add to their slopes while beads move along.
    """
    fit, n, prior = model.known(fit), fit.coefficients.size, model.nodes.information
    whole = model.around(fit).information
    mixed = np.concatenate([-solved(whole[:-n, :-n], whole[:-n, -n:]), np.eye(n)])
    information = mixed.T @ whole @ mixed
    pearson = max(model.misfit(fit).pearson, 1.0)
    scatter = Clusters.of(calibration, n).scatter(model.scores(fit, mixed), pearson * information)
    return widened(information + prior, information / pearson + prior, scatter)
