"""What the refinement looks at: the sharp image, and what focus and aggregation tell of every pixel."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfstereo.network.volume import mode_mean, warp_right

_FULL_PX = 100.0
_CONFIRMED_BINS = 1.5
"""Difference of the two eyes' disparities below which they confirm each other."""


def focus_disparity(scores: Tensor, foci: Tensor) -> tuple[Tensor, Tensor]:
    """Read the disparity in focus, and how likely it is, from the scores of the slices.

    Parameters
    ----------
    scores
        ``(B, K, h, w)`` logits.
    foci
        ``(K,)`` px.

    Returns
    -------
    tuple
        Disparity in px and the highest probability, ``(B, 1, 4 h, 4 w)``.
    """
    likely = F.softmax(scores, dim=1).amax(1, keepdim=True)
    both = torch.cat((mode_mean(scores, foci), likely), dim=1)
    found = F.interpolate(both, scale_factor=4, mode="bilinear", align_corners=False)
    return found[:, :1], found[:, 1:]


def confirmed(left_right: Tensor) -> Tensor:
    """Tell where the right eye's own disparity agrees.

    Parameters
    ----------
    left_right
        Of any shape: by how much it differs, in steps of the volume; -1 where the right eye cannot see the place.
    """
    return (left_right >= 0) & (left_right < _CONFIRMED_BINS)


def background_filled(best: Tensor, left_right: Tensor) -> Tensor:
    """Fill what the right eye does not confirm from the two confirmed pixels beside it in the row: the farther one.

    References
    ----------
    Hirschmüller, "Stereo processing by semiglobal matching and mutual information" (2008), section 2.5: occlusions.

    Parameters
    ----------
    best
        ``(B, 1, H, W)`` px.
    left_right
        ``(B, 1, H, W)`` by how much the right eye's own disparity differs, px; -1 where it cannot see the place.

    Examples
    --------
    >>> best, left_right = torch.tensor([[[[2.0, 9.0, 8.0, 5.0]]]]), torch.tensor([[[[0.0, 7.0, -1.0, 0.5]]]])
    >>> background_filled(best, left_right).flatten().tolist()
    [2.0, 2.0, 2.0, 5.0]
    """
    width = best.shape[-1]
    sure = confirmed(left_right)
    x = torch.arange(width, device=best.device).expand(best.shape)
    before = torch.where(sure, x, -1).cummax(-1).values
    after = torch.where(sure, x, width).flip(-1).cummin(-1).values.flip(-1)
    far = torch.full_like(best, torch.inf)
    filled = torch.minimum(
        torch.where(before >= 0, best.gather(-1, before.clamp(min=0)), far),
        torch.where(after < width, best.gather(-1, after.clamp(max=width - 1)), far),
    )
    return torch.where(filled.isinf(), best, filled)


def clue_maps(
    sharp: Tensor, readings: Tensor, focus: tuple[Tensor, Tensor] | None, other: Tensor | None
) -> tuple[Tensor, Tensor]:
    """Put together the clues and the offers of :class:`lfstereo.network.refine_net.RefineNet`.

    Parameters
    ----------
    sharp
        ``(B, 3, H, W)`` all-in-focus image of the left eye.
    readings
        ``(B, 6, H, W)`` of :func:`lfstereo.network.semiglobal.read_out`.
    focus
        Of :func:`focus_disparity`; ``None`` where there is no stack.
    other
        ``(B, 3, H, W)`` sharp image of the right eye; ``None`` where there is none.

    Returns
    -------
    tuple
        Clues ``(B, 16, H, W)`` and offers ``(B, 4, H, W)``.
    """
    best, second, margin, energy, left_right, near = torch.chunk(readings, 6, dim=1)
    none = torch.zeros_like(best)
    focused, likely = (best, none) if focus is None else focus
    error = none if other is None else (sharp - warp_right(other, best)).abs().mean(1, keepdim=True)
    filled = best if other is None else background_filled(best, left_right)
    unseen = (left_right < 0).to(best.dtype)
    stereo = none if other is None else none + 1
    clues = torch.cat(
        (
            sharp - 0.5,
            best / _FULL_PX,
            (second - best).clamp(-20, 20) / 20,
            margin.clamp(0, 6) / 6,
            energy.clamp(0, 8) / 8,
            left_right.clamp(0, 8) / 8 * stereo,
            unseen * stereo,
            near,
            (focused - best).clamp(-30, 30) / 30,
            likely,
            (filled - best).clamp(-30, 30) / 30,
            4 * error,
            none if focus is None else none + 1,
            stereo,
        ),
        dim=1,
    )
    return clues, torch.cat((best, second, focused, filled), dim=1)
