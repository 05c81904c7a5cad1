"""How far a disparity map is from the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Bool, Float32, check_shape
from lfstereo.errors import InputError, ShapeError


@dataclass(frozen=True, slots=True)
class DisparityScores:
    """Errors over the pixels whose truth is known and which the estimate answers."""

    mae_px: float
    rmse_px: float
    bad_05: float
    """Percent of the pixels that are off by more than 0.5 px."""
    bad_1: float
    bad_2: float
    bad_4: float
    density: float
    """Percent of the pixels with known truth that the estimate answers."""
    pixels: int
    """Number of pixels with known truth."""


def score_disparity(
    disparity: Float32, truth: Float32, truth_valid: Bool, estimate_valid: Bool | None = None
) -> DisparityScores:
    """Compare a disparity map with the truth.

    Scores of maps with different density are not comparable: fill the map, or pass ``None`` for
    ``estimate_valid`` so that every pixel with known truth counts.

    Parameters
    ----------
    disparity, truth
        ``(V, U)`` px.
    truth_valid
        ``(V, U)``: where the truth is known, less what is not to be judged (occlusions, borders).
    estimate_valid
        ``(V, U)``: where the estimate answers; ``None`` judges it everywhere.

    Raises
    ------
    ShapeError
        If the arrays differ in shape.
    InputError
        If no pixel can be judged, or a judged value is not finite.

    References
    ----------
    Scharstein and Szeliski, "A taxonomy and evaluation of dense two-frame stereo correspondence algorithms"
    (2002), equations 1 and 2: RMS error and percentage of bad matching pixels.

    Examples
    --------
    Errors of 0, 1.5 and 3 px.

    >>> found = score_disparity(np.float32([[5, 6.5, 8]]), np.float32([[5, 5, 5]]), np.ones((1, 3), bool))
    >>> found.mae_px, round(found.bad_1, 2), round(found.bad_2, 2)
    (1.5, 66.67, 33.33)
    """
    check_shape("disparity", disparity, (None, None))
    answered = np.ones(disparity.shape, np.bool_) if estimate_valid is None else estimate_valid
    for name, array in (("truth", truth), ("truth_valid", truth_valid), ("estimate_valid", answered)):
        if array.shape != disparity.shape:
            raise ShapeError(f"{name}: found shape {array.shape}, expected {disparity.shape} as the disparity")
    judged = truth_valid & answered
    if not judged.any():
        raise InputError("scores: no pixel has both a known truth and an estimate; check the two masks")
    error = np.abs(disparity[judged].astype(np.float64) - truth[judged].astype(np.float64))
    if not np.isfinite(error).all():
        raise InputError("scores: a judged disparity is not finite; leave such pixels out of the masks")

    def bad(limit_px: float) -> float:
        return 100.0 * float(np.mean(error > limit_px))

    return DisparityScores(
        mae_px=float(error.mean()),
        rmse_px=float(np.sqrt(np.mean(error**2))),
        bad_05=bad(0.5),
        bad_1=bad(1.0),
        bad_2=bad(2.0),
        bad_4=bad(4.0),
        density=100.0 * float(judged.sum() / truth_valid.sum()),
        pixels=int(truth_valid.sum()),
    )
