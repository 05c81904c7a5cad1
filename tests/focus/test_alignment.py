"""Alignment of sweeps whose breathing and shake are known."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.errors import AlignmentError, ConfigError
from lfstereo.focus.alignment import AlignOptions, align_sweep
from lfstereo.focus.importers import ImportOptions, read_sweep
from lfstereo.focus.sweep import FocusSweep, LensData

SIZE = (180, 240)
ALIGNED_PX = 0.15
"""Anywhere in the frame, over a chain of two neighbours of unlike blur."""


def scene(seed: int = 0, size: tuple[int, int] = (480, 640)) -> np.ndarray:
    """Coloured blotches of many sizes."""
    rng = np.random.default_rng(seed)
    total = np.full((*size, 3), 0.4)
    for sigma in (1.5, 4.0, 12.0):
        layer = cv2.GaussianBlur(rng.standard_normal((*size, 3)), (0, 0), sigma)
        total += 0.09 * layer / layer.std()
    return np.clip(total, 0.02, 1).astype(np.float32)


def sweep_of(transforms: list[np.ndarray], blurs: list[float], gains: list[float] | None = None) -> FocusSweep:
    """Views of one scene; the transforms take px of the first-named frame to px of each slice."""
    wide, slices = scene(), []
    offset = np.array([[1, 0, 200], [0, 1, 150], [0, 0, 1.0]])
    for k, (transform, blur) in enumerate(zip(transforms, blurs, strict=True)):
        scene_from_slice = offset @ np.linalg.inv(transform)
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        view = cv2.warpPerspective(wide, scene_from_slice, SIZE[::-1], flags=flags)
        slices.append(cv2.GaussianBlur(view, (0, 0), blur) * np.float32(1 if gains is None else gains[k]))
    names = tuple(f"{k}.png" for k in range(len(slices)))
    return FocusSweep(np.stack(slices), names, None, SIZE, LensData(), "sweep")


def scaled(scale: float, x: float, y: float) -> np.ndarray:
    cx, cy = (SIZE[1] - 1) / 2, (SIZE[0] - 1) / 2
    return np.array([[scale, 0, cx + x - scale * cx], [0, scale, cy + y - scale * cy], [0, 0, 1]])


def misfit_px(found: np.ndarray, true: list[np.ndarray]) -> float:
    """Largest distance of a corner of any slice from where it is seen in truth."""
    corners = np.array([[0, 0, 1], [SIZE[1] - 1, 0, 1], [0, SIZE[0] - 1, 1], [SIZE[1] - 1, SIZE[0] - 1, 1.0]]).T
    middle, worst = np.linalg.inv(true[len(true) // 2]), 0.0
    for one, other in zip(found, true, strict=True):
        a, b = one @ corners, other @ middle @ corners
        worst = max(worst, float(np.hypot(*(a[:2] / a[2] - b[:2] / b[2])).max()))
    return worst


BREATHING = [scaled(0.97, 3.2, -1.5), scaled(1.0, 0, 0), scaled(1.025, -2.4, 4.6)]
BLURS = [2.5, 0.8, 2.0]


def test_breathing_shake_and_exposure_are_taken_out() -> None:
    aligned = align_sweep(sweep_of(BREATHING, BLURS, [1.0, 1.0, 0.8]))
    assert misfit_px(aligned.slice_from_reference, BREATHING) < ALIGNED_PX
    assert aligned.gains == pytest.approx([1.0, 1.0, 1.25], rel=0.03)
    assert aligned.correlation.min() > 0.95
    assert 0.85 < aligned.seen.mean() < 1
    assert aligned.moved_px[1] == 0 and aligned.moved_px[0] > 5


def test_aligned_slices_coincide() -> None:
    aligned = align_sweep(sweep_of(BREATHING, [1.0, 1.0, 1.0]))
    inner = aligned.seen.copy()
    inner[:8], inner[-8:], inner[:, :8], inner[:, -8:] = False, False, False, False
    first, middle, last = aligned.sweep.slices
    for other in (first, last):
        assert float(np.sqrt(np.mean((other - middle)[inner] ** 2))) < 0.01  # of white; 0.15 before


def test_homography_of_a_turned_camera() -> None:
    turned = scaled(1.01, 2, 1) @ np.array([[1, 0.02, 0], [-0.02, 1, 0], [3e-5, 1e-5, 1]])
    true = [scaled(1.0, 0, 0), turned]
    aligned = align_sweep(sweep_of(true, [1.0, 1.8]), AlignOptions(align="homography"))
    assert misfit_px(aligned.slice_from_reference, true) < 2 * ALIGNED_PX  # eight unknowns


def test_large_shake_is_found_by_features() -> None:
    true = [scaled(1.0, 0, 0), scaled(1.1, 45.0, -30.0)]
    aligned = align_sweep(sweep_of(true, [1.0, 1.4]))
    assert misfit_px(aligned.slice_from_reference, true) < ALIGNED_PX


def test_pictures_that_coincide_are_left_as_they_are() -> None:
    sweep = sweep_of([scaled(1, 0, 0)] * 3, [3.0, 1.0, 2.0])
    aligned = align_sweep(sweep, AlignOptions(even_exposure=False))
    np.testing.assert_array_equal(aligned.sweep.slices, sweep.slices)
    assert aligned.seen.all() and not aligned.moved_px.any()


def test_none_leaves_all_as_it_is() -> None:
    sweep = sweep_of(BREATHING, BLURS)
    aligned = align_sweep(sweep, AlignOptions(align="none", even_exposure=False))
    np.testing.assert_array_equal(aligned.sweep.slices, sweep.slices)


def test_refuses_pictures_of_different_scenes() -> None:
    sweep = sweep_of([scaled(1, 0, 0)] * 2, [1.0, 1.0])
    sweep.slices[1] = scene(7)[: SIZE[0], : SIZE[1]]
    with pytest.raises(AlignmentError, match=r"0.png and 1.png: cannot be brought to coincide \(correlation"):
        align_sweep(sweep)
    with pytest.raises(ConfigError, match="align = 'affine'"):
        align_sweep(sweep, AlignOptions(align="affine"))  # type: ignore[arg-type]


def test_refuses_a_sweep_that_wanders_off() -> None:
    """Every step can be aligned, but nothing is in the first picture and in the last."""
    steps = [scaled(1, 60.0 * k, 0) for k in range(-2, 4)]
    with pytest.raises(AlignmentError, match="no part of the scene is in all pictures"):
        align_sweep(sweep_of(steps, [1.0] * 6))


def test_photographs_of_a_board_are_aligned(real_data: Path, tmp_path: Path) -> None:
    """A microscope's sweep that breathes by 7 percent."""
    for path in sorted((real_data / "focal" / "aimonen_depthmap").glob("pcb*"))[3:6]:
        (tmp_path / path.name).symlink_to(path)
    aligned = align_sweep(read_sweep(tmp_path, ImportOptions(width_px=500)))
    assert aligned.correlation.min() > 0.98
    assert 2 < aligned.moved_px.max() < 20
