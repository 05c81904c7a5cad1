"""One method on one scene of known disparity: its errors as a row, and the mean over many rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from lfstereo.arrays import Bool, Float32, Rgb
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.depth.baselines import fill_from_background, sgbm_wls
from lfstereo.depth.disparity import DisparityMap
from lfstereo.depth.metrics import score_disparity
from lfstereo.simulate.stack_dataset import DualStack

ALL = "all"


@dataclass(frozen=True, slots=True)
class Row:
    """What one method got on one scene, or on all; ``None`` where it does not apply."""

    scene: str
    method: str
    mae_norm: float | None
    """Mean absolute error in units of 100 px."""
    mae_px: float | None
    bad_05: float | None
    """Percent of the answered pixels that are off by more than 0.5 px."""
    bad_1: float | None
    bad_2: float | None
    bad_4: float | None
    density: float | None
    """Percent of the pixels of known truth that are answered."""
    seconds: float
    psnr_db: float | None = None
    """Of the all-in-focus image against the sharp one, display-referred."""


def score_row(case: DualStack, method: str, disparity: Float32, seconds: float, answered: Bool | None = None) -> Row:
    """Judge a disparity map; only answered pixels count where ``answered`` says which are."""
    if answered is not None and not (answered & case.known).any():
        return Row(case.name, method, None, None, None, None, None, None, 0.0, seconds)
    scores = score_disparity(np.maximum(disparity, 0), case.disparity, case.known, answered)
    return Row(
        scene=case.name,
        method=method,
        mae_norm=scores.mae_px / DISPARITY_RANGE_PX,
        mae_px=scores.mae_px,
        bad_05=scores.bad_05,
        bad_1=scores.bad_1,
        bad_2=scores.bad_2,
        bad_4=scores.bad_4,
        density=scores.density,
        seconds=seconds,
    )


def summarise(rows: Sequence[Row]) -> list[Row]:
    """Average every column over the scenes, each scene weighing the same; one row per method.

    Examples
    --------
    >>> def one(mae): return Row("a", "SGBM", mae / 100, mae, 1.0, 1.0, 1.0, 1.0, 90.0, 0.5)
    >>> summarise([one(2.0), one(4.0)])[0].mae_px
    3.0
    """
    numbers = [f.name for f in fields(Row) if f.name not in ("scene", "method")]
    found = []
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        columns = {name: [getattr(row, name) for row in own] for name in numbers}
        means = {n: None if None in values else math.fsum(values) / len(values) for n, values in columns.items()}
        found.append(Row(ALL, method, **means))  # type: ignore[arg-type]
    return found


def psnr_db(picture: Float32, truth: Float32, counted: Bool) -> float:
    """Return the peak signal-to-noise ratio of a picture in 0 to 1, over the counted pixels.

    Examples
    --------
    >>> round(psnr_db(np.full((2, 2, 3), 0.6), np.full((2, 2, 3), 0.5), np.ones((2, 2), bool)), 6)
    20.0
    """
    error = float(np.mean((np.clip(picture, 0, 1).astype(np.float64) - truth)[counted] ** 2))
    return -10 * math.log10(max(error, 1e-12))


def wls_filled(left: Rgb, right: Rgb, d_max: float) -> DisparityMap:
    """Match and fill; a pair without a single match stays without answers."""
    found = sgbm_wls(left, right, d_max)
    return fill_from_background(found) if found.valid.any() else found
