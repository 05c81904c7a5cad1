"""The disparity map, the value that a pair of stacks is turned into."""

from __future__ import annotations

from dataclasses import dataclass

from lfstereo.arrays import Bool, Disparity, Rgb


@dataclass(frozen=True, slots=True)
class DisparityMap:
    """Disparity of the rectified left centre view."""

    disparity: Disparity
    """``(V, U)`` float32 px, >= 0; finite everywhere, also where not valid."""
    valid: Bool
    """``(V, U)``: false where the pair gives no support (outside the common field of view)."""
    all_in_focus: Rgb
    """``(V, U, 3)`` linear RGB of the left view, everything sharp."""
