"""Volumes over the disparity axis: matching, aggregation and the read-out of a disparity.

A bin is a hypothesis "the disparity is b px". The same aggregation serves the stereo volume (27 bins of 4 px) and the
focus volume (16 slices): three-dimensional convolutions share their weights along the disparity axis, a stack of
hourglasses brings in the picture's context.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.network.blocks import ConvBlock, ConvBlock3d, Hourglass, Residual


def group_correlation(left: Tensor, right: Tensor, bins: int, groups: int) -> Tensor:
    """Correlate left features with right features at every shift.

    Parameters
    ----------
    left, right
        ``(B, C, h, w)`` features.
    bins
        Shifts 0 to ``bins - 1``, in px of the feature maps.
    groups
        The channels are normalised and correlated in this many groups.

    Returns
    -------
    Tensor
        ``(B, groups, bins, h, w)`` cosine, -1 to 1; 0 where the right image has no such pixel.

    References
    ----------
    Guo et al., "Group-wise correlation stereo network" (2019), eq. 2.
    """
    batch, channels, h, w = left.shape
    a = F.normalize(left.reshape(batch, groups, channels // groups, h, w), dim=2)
    b = F.normalize(right.reshape(batch, groups, channels // groups, h, w), dim=2)
    planes = []
    for shift in range(bins):
        if shift >= w:
            planes.append(a.new_zeros(batch, groups, h, w))
            continue
        product = (a[..., shift:] * b[..., : w - shift]).sum(2)
        planes.append(F.pad(product, (shift, 0)))
    return torch.stack(planes, dim=2)


def likeness(left: Tensor, right: Tensor, window: int) -> Tensor:
    """Zero-mean normalised cross-correlation of two aligned images in square windows.

    Parameters
    ----------
    left, right
        ``(B, 3, h, w)`` display-referred.
    window
        Side of the window in px, odd.

    Returns
    -------
    Tensor
        ``(B, 1, h, w)``, -1 to 1; near 0 where either window is plain (:data:`PLAIN_VARIANCE`).

    References
    ----------
    Lewis, "Fast normalized cross-correlation" (1995), eq. 2, with a floor under the variances.
    """
    moments = _box(torch.cat((left, right, left * left, right * right, left * right), dim=1), window)
    mean_l, mean_r, square_l, square_r, product = torch.chunk(moments, 5, dim=1)
    variance_l = (square_l - mean_l * mean_l).sum(1, keepdim=True).clamp(min=0) + PLAIN_VARIANCE
    variance_r = (square_r - mean_r * mean_r).sum(1, keepdim=True).clamp(min=0) + PLAIN_VARIANCE
    covariance = (product - mean_l * mean_r).sum(1, keepdim=True)
    return covariance * torch.rsqrt(variance_l * variance_r)


def _box(image: Tensor, window: int) -> Tensor:
    """Mean over square windows, the border repeated."""
    channels, half = image.shape[1], window // 2
    ones = image.new_full((channels, 1, window, 1), 1 / window)
    padded = F.pad(image, (half, half, half, half), mode="replicate")
    return F.conv2d(F.conv2d(padded, ones, groups=channels), ones.transpose(2, 3), groups=channels)


def window_vectors(image: Tensor, dilation: int) -> Tensor:
    """Describe every pixel by its 5 x 5 window (every ``dilation``-th px), mean removed, length at most 1.

    The dot product of two such vectors is the windows' zero-mean normalised cross-correlation, :func:`likeness`.

    Returns
    -------
    Tensor
        ``(B, h, w, 75)``.
    """
    batch, colours, h, w = image.shape
    reach = 2 * dilation
    padded = F.pad(image, (reach, reach, reach, reach), mode="replicate")
    windows = F.unfold(padded, 5, dilation=dilation).view(batch, colours, 25, h, w)
    windows = windows - windows.mean(2, keepdim=True)
    floor = 25 * PLAIN_VARIANCE
    windows = windows / torch.sqrt(windows.square().sum((1, 2), keepdim=True) + floor)
    return windows.flatten(1, 2).permute(0, 2, 3, 1)


@torch.no_grad()
def likeness_volume(left: Tensor, right: Tensor, bins: int, dilations: tuple[int, ...]) -> Tensor:
    """Compare half-resolution images at every shift, without learned weights.

    Parameters
    ----------
    left, right
        ``(B, 3, 2 h, 2 w)`` display-referred, half the resolution of the pictures.
    bins
        Bin j stands for the shifts 2 j and 2 j + 1 of these images.
    dilations
        Of the windows of :func:`window_vectors`.

    Returns
    -------
    Tensor
        ``(B, 2 len(dilations), bins, h, w)``; 0 where the right image has no such pixel.
    """
    batch, _, height, width = left.shape
    x = torch.arange(width, device=left.device).view(-1, 1)
    match = x - torch.arange(2 * bins, device=left.device)
    groups: list[Tensor] = []
    for dilation in dilations:
        a, b = (window_vectors(image, dilation).flatten(0, 1) for image in (left, right))
        every = torch.bmm(a, b.transpose(1, 2))
        index = match.clamp(min=0).expand(batch * height, -1, -1)
        shifts = every.gather(2, index) * (match >= 0)
        shifts = shifts.view(batch, height // 2, 2, width // 2, 2, 2 * bins).mean((2, 4))
        shifts = shifts.permute(0, 3, 1, 2)
        groups.extend((shifts[:, 0::2], shifts[:, 1::2]))
    return torch.stack(groups, dim=1)


def soft_argmax(logits: Tensor, values: Tensor) -> Tensor:
    """Return the expected value over the bins, ``(B, 1, h, w)``.

    Examples
    --------
    >>> logits = torch.zeros(1, 2, 1, 1)
    >>> float(soft_argmax(logits, torch.tensor([0.0, 1.0])))
    0.5
    """
    return (F.softmax(logits, dim=1) * values.view(1, -1, 1, 1)).sum(1, keepdim=True)


def mode_mean(logits: Tensor, values: Tensor, reach: int = 2) -> Tensor:
    """Return the expected value over the bins near the most likely one, ``(B, 1, h, w)``.

    At the edge of an object two disparities are likely; the mean over all bins would lie between, where nothing is.

    Parameters
    ----------
    logits
        ``(B, bins, h, w)``.
    values
        ``(bins,)``.
    reach
        Bins taken on either side of the most likely one (after a mean over 3 bins).

    References
    ----------
    Tulyakov, Ivanov, Fleuret, "Practical deep stereo" (2018), section 3.3: the sub-pixel MAP estimate.

    Examples
    --------
    >>> logits = torch.tensor([2.0, 2.0, -9.0, -9.0, -9.0, 1.5]).view(1, 6, 1, 1)
    >>> round(float(mode_mean(logits, torch.arange(6.0), reach=1)), 3)
    0.5
    """
    share = F.softmax(logits, dim=1)
    with torch.no_grad():
        smooth = share + F.pad(share[:, 1:], (0, 0, 0, 0, 0, 1)) + F.pad(share[:, :-1], (0, 0, 0, 0, 1, 0))
        likeliest = smooth.argmax(1, keepdim=True)
        near = (torch.arange(len(values), device=logits.device).view(1, -1, 1, 1) - likeliest).abs() <= reach
    share = share * near
    return (share * values.view(1, -1, 1, 1)).sum(1, keepdim=True) / share.sum(1, keepdim=True)


def resample_bins(share: Tensor, near: float, far: float, values: Tensor) -> Tensor:
    """Interpolate probabilities over evenly spaced slices at other disparities.

    Parameters
    ----------
    share
        ``(B, K, h, w)`` for slices from ``near`` to ``far``.
    near, far
        Disparity of the first and of the last slice.
    values
        ``(bins,)`` where the answer is wanted, same unit; beyond the slices the end slice's value holds.

    Returns
    -------
    Tensor
        ``(B, bins, h, w)``.

    Examples
    --------
    >>> share = torch.tensor([0.8, 0.2]).view(1, 2, 1, 1)
    >>> resample_bins(share, 10.0, 0.0, torch.tensor([5.0, 12.0])).flatten().tolist()
    [0.5, 0.800000011920929]
    """
    last = share.shape[1] - 1
    position = ((near - values) / (near - far)).clamp(0, 1) * last
    lower = position.floor().clamp(max=last - 1).long()
    upper_share = (position - lower).view(1, -1, 1, 1)
    return share[:, lower] * (1 - upper_share) + share[:, lower + 1] * upper_share


def warp_right(right: Tensor, disparity_px: Tensor) -> Tensor:
    """Fetch ``right`` at ``x - d`` for every left pixel.

    Parameters
    ----------
    right
        ``(B, C, h, w)``.
    disparity_px
        ``(B, 1, h, w)`` px of these maps.
    """
    _, _, h, w = right.shape
    x = torch.arange(w, device=right.device, dtype=right.dtype).view(1, 1, w) - disparity_px[:, 0]
    y = torch.arange(h, device=right.device, dtype=right.dtype).view(1, h, 1).expand_as(x)
    grid = torch.stack((2 * x / (w - 1) - 1, 2 * y / max(h - 1, 1) - 1), dim=-1)
    return F.grid_sample(right, grid, mode="bilinear", padding_mode="zeros", align_corners=True)


PLAIN_VARIANCE = 5e-4
"""Variance (display-referred, all colours) below which a window counts as plain: noise of about 0.013 per colour."""


class VolumeAggregation(nn.Module):
    """Volume and guide features to logits over the bins, one set per hourglass.

    Parameters
    ----------
    groups, bins
        Of the volume ``(B, groups, bins, h, w)``.
    guide
        Channels of the guide features ``(B, guide, h, w)``.
    channels, depth, stacks
        Of the hourglasses.
    """

    def __init__(self, groups: int, bins: int, guide: int, channels: int, depth: int, stacks: int) -> None:
        super().__init__()
        self.local = nn.Sequential(ConvBlock3d(groups, groups), ConvBlock3d(groups, groups))
        self.score = nn.Conv3d(groups, 1, 3, 1, 1)
        self.enter = ConvBlock(groups * bins + guide, channels, 3)
        self.glasses = nn.ModuleList(
            nn.Sequential(Hourglass(channels, depth), Residual(channels, channels)) for _ in range(stacks)
        )
        self.heads = nn.ModuleList(nn.Conv2d(channels, bins, 1) for _ in range(stacks))
        self.back = nn.ModuleList(nn.Conv2d(bins, channels, 1) for _ in range(stacks - 1))

    def forward(self, volume: Tensor, guide: Tensor) -> tuple[list[Tensor], Tensor]:
        """Return the logits ``(B, bins, h, w)`` from coarse to final, and the last features ``(B, channels, h, w)``."""
        volume = volume + self.local(volume)
        logits = [self.score(volume)[:, 0]]
        x = self.enter(torch.cat((volume.flatten(1, 2), guide), dim=1))
        features = x
        for index, (glass, head) in enumerate(zip(self.glasses, self.heads, strict=True)):
            features = glass(x)
            logits.append(logits[-1] + head(features))
            if index < len(self.back):
                x = x + features + self.back[index](F.softmax(logits[-1], dim=1))
        return logits, features
