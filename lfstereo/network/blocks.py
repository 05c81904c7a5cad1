"""Building blocks of all networks: convolution, batch normalisation, PReLU; the residual module; the hourglass.

Batch normalisation stands between the convolution and the PReLU, weights start from He's normal distribution.
At inference :func:`fold_batch_norms` merges every normalisation into its convolution.

References
----------
He et al., "Delving deep into rectifiers" (2015), eq. 14: PReLU and the initialisation.
Newell, Yang, Deng, "Stacked hourglass networks for human pose estimation" (2016), fig. 3 and 4.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

Convolution = nn.Conv2d | nn.Conv3d | nn.ConvTranspose2d


class ConvBlock(nn.Module):
    """Convolution, batch normalisation, PReLU.

    Parameters
    ----------
    inputs, outputs
        Channels.
    kernel, stride
        In px; the padding keeps ``size / stride`` for odd kernels.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> None:
        super().__init__()
        self.conv: nn.Module = nn.Conv2d(inputs, outputs, kernel, stride, (kernel - 1) // 2)
        self.norm: nn.Module = nn.BatchNorm2d(outputs)
        self.act = nn.PReLU(outputs)

    def forward(self, x: Tensor) -> Tensor:
        """Return ``(B, outputs, H / stride, W / stride)``."""
        out: Tensor = self.act(self.norm(self.conv(x)))
        return out


class ConvBlock3d(ConvBlock):
    """The same over a volume ``(B, C, D, H, W)``, kernel 3, stride 1."""

    def __init__(self, inputs: int, outputs: int, kernel: int = 3) -> None:
        super().__init__(inputs, outputs)
        self.conv = nn.Conv3d(inputs, outputs, kernel, 1, (kernel - 1) // 2)
        self.norm = nn.BatchNorm3d(outputs)


class DeconvBlock(ConvBlock):
    """Transposed convolution that enlarges ``stride`` times (kernel ``2 stride``), batch normalisation, PReLU."""

    def __init__(self, inputs: int, outputs: int, stride: int = 2) -> None:
        super().__init__(inputs, outputs)
        self.conv = nn.ConvTranspose2d(inputs, outputs, 2 * stride, stride, stride // 2)


class Residual(nn.Module):
    """Newell's residual module: 1x1 to half the channels, 3x3, 1x1 back, added to its input."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        half = outputs // 2
        self.body = nn.Sequential(ConvBlock(inputs, half, 1), ConvBlock(half, half, 3), nn.Conv2d(half, outputs, 1))
        self.skip = nn.Conv2d(inputs, outputs, 1) if inputs != outputs else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        """Return ``(B, outputs, H, W)``."""
        out: Tensor = self.body(x) + self.skip(x)
        return out


class Hourglass(nn.Module):
    """Max-pool ``depth`` times, deconvolve back, with a residual module on every skip.

    The height and width of the input must be multiples of ``2**depth``.
    """

    def __init__(self, channels: int, depth: int) -> None:
        super().__init__()
        self.skip = Residual(channels, channels)
        self.down = nn.Sequential(nn.MaxPool2d(2), Residual(channels, channels))
        self.inner: nn.Module = Hourglass(channels, depth - 1) if depth > 1 else Residual(channels, channels)
        self.up = nn.Sequential(Residual(channels, channels), DeconvBlock(channels, channels, 2))

    def forward(self, x: Tensor) -> Tensor:
        """Return features of the input's shape."""
        out: Tensor = self.skip(x) + self.up(self.inner(self.down(x)))
        return out


def initialise(module: nn.Module) -> None:
    """Draw all convolution weights from He's normal distribution (PReLU slope 0.25), biases 0."""
    for part in module.modules():
        if isinstance(part, Convolution):
            nn.init.kaiming_normal_(part.weight, a=0.25)
            if part.bias is not None:
                nn.init.zeros_(part.bias)


def fold_batch_norms(module: nn.Module) -> None:
    """Merge every batch normalisation into the convolution before it, in place; the network must be in eval mode.

    Raises
    ------
    ValueError
        If the network is in training mode, where the normalisation depends on the batch.
    """
    if module.training:
        raise ValueError("fold_batch_norms: the network is in training mode, expected eval mode; call .eval() first")
    for part in module.modules():
        if isinstance(part, ConvBlock) and isinstance(part.norm, nn.BatchNorm2d | nn.BatchNorm3d):
            assert isinstance(part.conv, Convolution)
            _fold(part.conv, part.norm)
            part.norm = nn.Identity()


@torch.no_grad()
def _fold(conv: Convolution, norm: nn.BatchNorm2d | nn.BatchNorm3d) -> None:
    assert norm.running_var is not None and norm.running_mean is not None and conv.bias is not None
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    axis = 1 if isinstance(conv, nn.ConvTranspose2d) else 0
    shape = [1] * conv.weight.ndim
    shape[axis] = -1
    conv.weight.mul_(scale.view(shape))
    conv.bias.copy_((conv.bias - norm.running_mean) * scale + norm.bias)


def channels_last(module: nn.Module) -> nn.Module:
    """Store all weights channels-last, in place: twice the speed of convolutions on a processor."""
    for part in module.parameters():
        if part.ndim == 4:
            part.data = part.data.contiguous(memory_format=torch.channels_last)
        elif part.ndim == 5:
            part.data = part.data.contiguous(memory_format=torch.channels_last_3d)
    return module
