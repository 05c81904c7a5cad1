"""Fidelity and time of the Virtual DSLR against the exact integral over many true views of layered scenes.

Run: ``python benchmarks/bench_virtual_dslr.py``. The scenes have curved and slanted surfaces and exact occlusion; the
truth is the mean of 160 rendered views, sheared to the focal plane. PSNR in linear light, white = 99.5th percentile.
"""

from __future__ import annotations

import time

import cv2
import numpy as np

from lfstereo.simulate.virtual_dslr import VirtualDslrOptions, lens_points, virtual_dslr
from lfstereo.training.scenes import Scene, random_scene, render
from lfstereo.training.textures import texture_bank
from lfstereo.training.tracing import shear_add

SCENES = 8
SIZE = (192, 256)
TRUE_VIEWS = 160
BORDER_PX = 12
EDGE_PX = 6
SETTINGS = {"a 0.4, d 0 to 32 px": (0.4, 32.0, (30, 22, 12, 2)), "a 0.1, d 0 to 100 px": (0.1, 100.0, (90, 60, 30, 5))}


def exact_slices(scene: Scene, foci: np.ndarray, aperture_ratio: float) -> np.ndarray:
    """Average true views from points of the lens."""
    points = lens_points(TRUE_VIEWS) * (aperture_ratio / 2)
    margin = int(np.ceil(aperture_ratio / 2 * foci.max())) + 3
    total = np.zeros((len(foci), scene.height, scene.width, 3), np.float32)
    for x, y in points:
        view = render(scene, float(x), float(y), margin=margin).image
        shear_add(view, foci * np.float32(x), foci * np.float32(y), margin, total)
    return total / np.float32(TRUE_VIEWS)


def near_edges(disparity: np.ndarray) -> np.ndarray:
    """Pixels within 6 px of a jump of more than 1 px of disparity."""
    jump = cv2.morphologyEx(disparity, cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8)) > 1.0
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * EDGE_PX + 1, 2 * EDGE_PX + 1))
    return cv2.dilate(jump.astype(np.uint8), disc) > 0


def main() -> None:
    """Print PSNR over all, near depth edges and elsewhere, and the time of a slice."""
    bank = texture_bank(5, 24)
    inner = (slice(BORDER_PX, -BORDER_PX), slice(BORDER_PX, -BORDER_PX))
    print(f"{SCENES} scenes of {SIZE[1]} x {SIZE[0]} px, {TRUE_VIEWS} true views, without {BORDER_PX} px of border")
    print(
        f"{'setting':<22}{'samples':>8}{'all dB':>8}{'edges dB':>10}{'rest dB':>9}{'worst scene':>13}{'ms/slice':>10}"
    )
    for name, (ratio, top, focus) in SETTINGS.items():
        foci = np.float32(focus)
        scenes = [random_scene(np.random.default_rng(seed), bank, *SIZE, top_px=top) for seed in range(SCENES)]
        truths = [exact_slices(scene, foci, ratio) for scene in scenes]
        for samples in (16, 48):
            options = VirtualDslrOptions(lens_samples=samples, noise=False, threads=1)
            errors: list[tuple[np.ndarray, np.ndarray]] = []
            seconds = []
            for scene, truth in zip(scenes, truths, strict=True):
                view = render(scene, 0, 0)
                started = time.perf_counter()
                found = virtual_dslr(view.image, view.disparity, foci, ratio, options).slices
                seconds.append(time.perf_counter() - started)
                error = ((found - truth) / np.percentile(view.image, 99.5)) ** 2
                edges = np.broadcast_to(near_edges(view.disparity), error.shape[:3])
                errors.append((error[:, *inner].reshape(-1, 3), edges[:, *inner].ravel()))
            every, edge = np.concatenate([e for e, _ in errors]), np.concatenate([m for _, m in errors])
            worst = min(decibel(e) for e, _ in errors)
            print(
                f"{name:<22}{samples:>8}{decibel(every):>8.1f}{decibel(every[edge]):>10.1f}{decibel(every[~edge]):>9.1f}"
                f"{worst:>13.1f}{1000 * min(seconds) / len(foci):>10.0f}"
            )


def decibel(squared_error: np.ndarray) -> float:
    """Return the PSNR in dB, white = 1."""
    return float(-10 * np.log10(squared_error.mean()))


if __name__ == "__main__":
    main()
