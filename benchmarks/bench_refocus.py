"""Time of a focal stack from a full-size light field, beside one cv2.warpAffine per view and slice.

Run: ``python benchmarks/bench_refocus.py``. Both are timed in the same run, so the ratio holds on a busy machine too.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2
import numpy as np

from lfstereo.focus.aperture import RefocusOptions, aperture_weights
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField

VIEWS = (15, 15, 434, 625)
SLOPES = np.linspace(0.35, -0.25, 16)
EVERY_VIEW = RefocusOptions(aperture="all")
REPEATS = 3


def one_warp_per_view(field: LightField, slope: float, aperture: np.ndarray) -> np.ndarray:
    """Refocus at one slope by translating every view on its own."""
    rows, columns = field.views.shape[2:4]
    t0, s0 = field.centre
    summed = np.zeros((rows, columns, 3), np.float32)
    total = np.zeros((rows, columns), np.float32)
    ones = np.ones((rows, columns), np.float32)
    for t, s in np.argwhere(aperture > 0):
        move = np.array([[1, 0, slope * (s - s0)], [0, 1, slope * (t - t0)]])
        weight = ones if field.weight is None else field.weight[t, s] / np.float32(255)
        view = field.views[t, s] if field.weight is None else field.views[t, s] * weight[..., None]
        summed += aperture[t, s] * cv2.warpAffine(view, move, (columns, rows), flags=cv2.INTER_LINEAR)
        total += aperture[t, s] * cv2.warpAffine(weight, move, (columns, rows), flags=cv2.INTER_LINEAR)
    return summed / total[..., None]


def best_seconds(task: Callable[[], object]) -> float:
    """Wall time of the fastest of a few runs."""
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        task()
        times.append(time.perf_counter() - started)
    return min(times)


def main() -> None:
    """Print the times and the largest difference of the two results."""
    rng = np.random.default_rng(0)
    views = rng.random((*VIEWS, 3), dtype=np.float32)
    weights = {"all samples alike": None, "weight per sample": rng.integers(1, 256, VIEWS, dtype=np.uint8)}
    print(f"{len(SLOPES)} slices from {VIEWS[0]} x {VIEWS[1]} views of {VIEWS[2]} x {VIEWS[3]} px, float32 RGB")
    for name, weight in weights.items():
        field = LightField(views, weight, None, "", "benchmark")
        aperture = aperture_weights(field, EVERY_VIEW)
        slices = refocus(field, SLOPES, EVERY_VIEW)  # compiles, or loads what was compiled
        ours = best_seconds(lambda field=field: refocus(field, SLOPES, EVERY_VIEW))
        reference = one_warp_per_view(field, SLOPES[2], aperture)
        theirs = len(SLOPES) * best_seconds(lambda f=field, a=aperture: one_warp_per_view(f, SLOPES[2], a))
        difference = float(np.abs(slices[2] - reference).max())
        print(
            f"{name:<18} lfstereo {ours:6.2f} s   warpAffine {theirs:6.2f} s   ratio {theirs / ours:5.1f}   "
            f"largest difference {difference:.1e}"
        )


if __name__ == "__main__":
    main()
