"""The disparity map, the value that a pair of stacks is turned into."""

from __future__ import annotations

from dataclasses import dataclass

from lfstereo.arrays import Bool, Disparity, Float32, Rgb, check_shape


@dataclass(frozen=True, slots=True)
class DisparityMap:
    """Disparity of the rectified left centre view."""

    disparity: Disparity
    """``(V, U)`` float32 px, >= 0; finite everywhere, also where not valid."""
    valid: Bool
    """``(V, U)``: false where the pair gives no support (outside the common field of view)."""
    all_in_focus: Rgb
    """``(V, U, 3)`` linear RGB of the left view, everything sharp."""
    uncertainty_px: Float32 | None = None
    """``(V, U)`` px, >= 0: how far off the disparity is expected to be, where its method tells."""

    def __post_init__(self) -> None:
        check_shape("disparity", self.disparity, (None, None))
        check_shape("valid pixels of the disparity", self.valid, self.disparity.shape)
        check_shape("all-in-focus picture of the disparity", self.all_in_focus, (*self.disparity.shape, 3))
        if self.uncertainty_px is not None:
            check_shape("uncertainty of the disparity", self.uncertainty_px, self.disparity.shape)
