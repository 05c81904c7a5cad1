"""Time of a focal stack from a full-size light field, beside one cv2.warpAffine per view and slice.

Run: ``python benchmarks/bench_refocus.py``. All are timed in the same run, so the ratios hold on a busy machine too.
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
SLICES, MORE_SLICES = 16, 64
NEAR, FAR = 0.35, -0.25
EVERY_VIEW = RefocusOptions(aperture="all")
CUBIC = RefocusOptions(aperture="all", interpolation="cubic")
FLOOR_S = 0.3  # one read of the light field and 6 G multiply-adds on 2 cores
REPEATS = 3
LARGEST_DIFFERENCE = 1e-3


def slopes(count: int) -> np.ndarray:
    """Even slopes of a scene from 0.6 to 1.2 m."""
    return np.linspace(NEAR, FAR, count)


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


def only_warps(field: LightField, at: np.ndarray) -> None:
    """Translate every view for every slope, and sum; no weights, no quotient: the least that way can cost."""
    rows, columns = field.views.shape[2:4]
    t0, s0 = field.centre
    for slope in at:
        summed = np.zeros((rows, columns, 3), np.float32)
        for t, s in np.ndindex(field.views.shape[:2]):
            move = np.array([[1, 0, slope * (s - s0)], [0, 1, slope * (t - t0)]])
            cv2.accumulate(cv2.warpAffine(field.views[t, s], move, (columns, rows), flags=cv2.INTER_LINEAR), summed)


def best_seconds(task: Callable[[], object], repeats: int = REPEATS) -> float:
    """Wall time of the fastest of a few runs."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        task()
        times.append(time.perf_counter() - started)
    return min(times)


def main() -> None:
    """Print the times and the largest difference of the two results."""
    rng = np.random.default_rng(0)
    views = rng.random((*VIEWS, 3), dtype=np.float32)
    weights = {"all samples alike": None, "weight per sample": rng.integers(1, 256, VIEWS, dtype=np.uint8)}
    print(f"{SLICES} slices from {VIEWS[0]} x {VIEWS[1]} views of {VIEWS[2]} x {VIEWS[3]} px, float32 RGB")
    for name, weight in weights.items():
        field = LightField(views, weight, None, "", "benchmark")
        aperture = aperture_weights(field, EVERY_VIEW)
        at = slopes(SLICES)
        slices = refocus(field, at, EVERY_VIEW)  # compiles, or loads what was compiled
        ours = best_seconds(lambda field=field, at=at: refocus(field, at, EVERY_VIEW))
        warped = np.empty_like(slices)

        def warp_all(field: LightField = field, aperture: np.ndarray = aperture, out: np.ndarray = warped) -> None:
            for k, slope in enumerate(slopes(SLICES)):
                out[k] = one_warp_per_view(field, float(slope), aperture)

        theirs = best_seconds(warp_all, 1)
        difference = float(np.abs(slices - warped).max())
        print(
            f"{name:<18} lfstereo {ours:6.2f} s   warpAffine {theirs:6.2f} s   ratio {theirs / ours:5.1f}   "
            f"of the floor of {FLOOR_S} s {ours / FLOOR_S:4.2f}   largest difference {difference:.1e}"
        )
        assert difference < LARGEST_DIFFERENCE, difference
    plain = LightField(views, None, None, "", "benchmark")
    ours, bare = (
        best_seconds(task, 2) for task in (lambda: refocus(plain, at, EVERY_VIEW), lambda: only_warps(plain, at))
    )
    print(f"{'warps and sums alone':<32} warpAffine {bare:6.2f} s   ratio {bare / ours:5.1f}")
    many = best_seconds(lambda: refocus(plain, slopes(MORE_SLICES), EVERY_VIEW), 2)
    print(f"{MORE_SLICES} slices            lfstereo {many:6.2f} s   {many / ours:.2f} times {SLICES} slices")
    cubic = best_seconds(lambda: refocus(plain, at, CUBIC), 2)
    print(f"cubic shifts         lfstereo {cubic:6.2f} s   {cubic / ours:.2f} times linear shifts")
    on_graphics_card(plain, at)


def on_graphics_card(field: LightField, at: np.ndarray) -> None:
    """Print the time of a stack from a light field that lies in the memory of a graphics card, where there is one."""
    import torch

    from lfstereo.network.refocus_device import refocus_resident, to_device

    if not torch.cuda.is_available():
        print("graphics card        none here, not measured")
        return
    views, aperture = to_device(field, "cuda"), aperture_weights(field, EVERY_VIEW)

    def stack() -> None:
        refocus_resident(views, at, aperture)
        torch.cuda.synchronize()

    stack()
    print(f"graphics card        lfstereo {1000 * best_seconds(stack):6.1f} ms   {torch.cuda.get_device_name()}")


if __name__ == "__main__":
    main()
