"""How far a calibration is off: what would become of it if each shot in turn were left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64

_LEAST_LEFT = 1e-6
"""Share of what is known of a combination of unknowns that the other shots must tell, in variances; below, the shot
alone tells it."""


@dataclass(frozen=True, slots=True)
class ShotEquations:
    """What one shot, its own pose taken out, says of the unknowns that all shots share."""

    normal: Float64
    """``(n, n)``: ``J'WJ``."""
    gradient: Float64
    """``(n,)``: ``J'Wr`` at the solution."""


def without_pose(normal: Float64, gradient: Float64, shared: int) -> ShotEquations:
    """Eliminate the last unknowns of one shot's equations, its pose, which no other shot knows of."""
    by_pose = np.linalg.solve(normal[shared:, shared:], normal[shared:, :shared])
    return ShotEquations(
        normal=normal[:shared, :shared] - normal[:shared, shared:] @ by_pose,
        gradient=gradient[:shared] - by_pose.T @ gradient[shared:],
    )


def jackknife_covariance(shots: Sequence[ShotEquations], expected: Float64, expected_scores: Float64) -> Float64:
    """Return the covariance of the shared unknowns, ``(n, n)``, from how far they move without each shot.

    Whatever the residuals of a shot have in common, over neighbouring corners, over views, over both cameras, counts
    as one error: shots only are taken as independent. A few shots tell a variance but roughly; the estimate errs on
    the large side, the more so the more depends on single shots.

    Parameters
    ----------
    shots
        Their equations at the solution.
    expected
        ``(n,)`` weight of what was expected of each unknown beforehand, added to the diagonal of ``J'WJ``.
    expected_scores
        ``(n,)`` variance of the pull of these expectations.

    References
    ----------
    Efron, "The jackknife, the bootstrap and other resampling plans" (1982), equation 3.12; one Newton step instead
    of each solution anew: Bell and McCaffrey, "Bias reduction in standard errors for linear regression with
    multi-stage samples" (Survey Methodology 2002), equation 2.6 and section 3.
    """
    total = sum((shot.normal for shot in shots), np.diag(expected))
    scale = np.sqrt(np.maximum(np.diag(total), 1e-300))
    values, vectors = np.linalg.eigh(total / np.outer(scale, scale))
    known = values > len(values) * np.finfo(np.float64).eps * values[-1]
    whitened = (vectors[:, known] / np.sqrt(values[known])).T / scale
    covariance: Float64 = whitened.T @ ((whitened * expected_scores) @ whitened.T) @ whitened
    share = (len(shots) - 1) / len(shots)
    for shot in shots:
        told, axes = np.linalg.eigh(whitened @ shot.normal @ whitened.T)
        moved = axes.T @ (whitened @ shot.gradient) / np.maximum(1 - told, _LEAST_LEFT)
        step = whitened.T @ (axes @ moved)
        covariance = covariance + share * np.outer(step, step)
    return covariance
