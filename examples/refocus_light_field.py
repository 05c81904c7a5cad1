"""Refocus a light field, and find depth from its focal stack alone.

The light field is made here: 9 x 9 views of a near disc before a far wall. In practice it comes from
``lfstereo.lightfield.read_light_field``. Writes the stack, the all-in-focus picture and the disparity it found.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from lfstereo.depth.colormap import DisparityScale, picture_disparity
from lfstereo.depth.pictures import write_png
from lfstereo.focus.measures import depth_from_focus
from lfstereo.focus.refocus import render_stack, slice_disparities
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField

VIEWS, ROWS, COLUMNS = 9, 160, 240
NEAR_SLOPE, FAR_SLOPE = 0.6, -0.4  # px of shift between neighbouring views; positive = nearer


def texture(seed: int, tint: tuple[float, float, float]) -> np.ndarray:
    """Return blotches of several sizes, ``(400, 400, 3)`` linear RGB."""
    rng = np.random.default_rng(seed)
    layers = (cv2.resize(rng.random((n, n)), (400, 400), interpolation=cv2.INTER_CUBIC) for n in (12, 40, 120))
    return (sum(layers)[..., None] / 3 * tint).clip(0, 1).astype(np.float32)


def light_field() -> LightField:
    """Return views that follow ``I_ts(x - slope (s - s0), y - slope (t - t0)) = I_centre(x, y)``."""
    wall, disc = texture(1, (0.4, 0.6, 0.9)), texture(2, (1.0, 0.7, 0.3))
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float32)
    views = np.empty((VIEWS, VIEWS, ROWS, COLUMNS, 3), np.float32)
    for t in range(VIEWS):
        for s in range(VIEWS):
            right, down = np.float32(s - VIEWS // 2), np.float32(t - VIEWS // 2)
            far = cv2.remap(wall, x + FAR_SLOPE * right + 60, y + FAR_SLOPE * down + 60, cv2.INTER_LINEAR)
            x_disc, y_disc = x + NEAR_SLOPE * right, y + NEAR_SLOPE * down
            near = cv2.remap(disc, x_disc + 60, y_disc + 60, cv2.INTER_LINEAR)
            covered = np.clip(50 - np.hypot(x_disc - COLUMNS / 2, y_disc - ROWS / 2), 0, 1)[..., None]
            views[t, s] = covered * near + (1 - covered) * far
    return LightField(views, weight=None, sampling=None, serial="", source="example")


def main(folder: Path) -> None:
    """Render 11 slices, find the focus, write the pictures."""
    field = light_field()
    # Disparity of a pair is an affine function of slope; here a pair with 50 px of disparity per px of slope.
    stack = render_stack(field, slice_disparities(50.0, 0.0, 11), slope_from_disparity=(0.02, -0.4))
    found = depth_from_focus(stack)
    for k, (picture, disparity) in enumerate(zip(stack.slices, stack.disparities_px, strict=True)):
        write_png(folder / f"slice_{k:02d}_{disparity:.0f}px.png", srgb8(picture), force=True)
    write_png(folder / "all_in_focus.png", srgb8(found.all_in_focus), force=True)
    scale = DisparityScale(near_px=52.0, far_px=-2.0)
    write_png(folder / "disparity.png", picture_disparity(found.disparity, None, scale), force=True)
    print(f"blur is {stack.aperture_ratio:.2f} px per px of disparity from the focus")
    for name, v, u in (("disc", ROWS // 2, COLUMNS // 2), ("wall", 20, 20)):
        print(f"{name}: found {np.median(found.disparity[v - 9 : v + 10, u - 9 : u + 10]):.1f} px")
    print("expected: disc 50.0 px, wall 0.0 px")


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "refocused")
    target.mkdir(parents=True, exist_ok=True)
    main(target)
