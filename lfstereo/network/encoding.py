"""Linear light to the display-referred values that the networks were trained on, and back."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float32

WHITE_PERCENTILE = 99.5
"""The brightness that becomes 1.0; the same for both stacks of a pair."""
GAMMA = 2.2


def exposure_of(*linear: Float32) -> float:
    """Return the linear value that becomes 1.0: a high percentile over all given images.

    Parameters
    ----------
    linear
        ``(..., H, W, 3)`` linear RGB; black margins are left out of the count.

    Examples
    --------
    >>> round(exposure_of(np.full((8, 8, 3), 0.25, np.float32)), 3)
    0.25
    """
    sampled = np.concatenate([image[..., ::2, ::2, :].ravel() for image in linear])
    lit = sampled[sampled > 1e-5]
    return max(float(np.percentile(lit, WHITE_PERCENTILE)), 1e-4) if lit.size else 1.0


def encode(linear: Float32, exposure: float) -> Float32:
    """Return ``clip(linear / exposure, 0, 1) ** (1 / 2.2)``, float32.

    Examples
    --------
    >>> float(encode(np.float32([0.5]), 0.5)[0])
    1.0
    """
    scaled = np.clip(linear * np.float32(1 / exposure), 0, 1)
    return np.asarray(np.power(scaled, np.float32(1 / GAMMA)), np.float32)


def decode(display: Float32, exposure: float) -> Float32:
    """Undo :func:`encode` for values that it did not clip."""
    return (np.power(np.clip(display, 0, None), np.float32(GAMMA)) * np.float32(exposure)).astype(np.float32)
