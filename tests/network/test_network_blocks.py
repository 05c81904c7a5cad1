"""Blocks: shapes, folding of the batch normalisation, initial weights."""

import pytest
import torch
from torch import nn

from lfstereo.network.blocks import (
    ConvBlock,
    ConvBlock3d,
    DeconvBlock,
    Hourglass,
    Residual,
    channels_last,
    fold_batch_norms,
    initialise,
)

FOLD_TOLERANCE = 1e-4  # of outputs of order 1, float32


def with_used_norms(module: nn.Module) -> nn.Module:
    """Give every normalisation statistics and weights that are not the neutral ones."""
    generator = torch.Generator().manual_seed(3)
    for part in module.modules():
        if isinstance(part, nn.BatchNorm2d | nn.BatchNorm3d):
            for tensor, low in (
                (part.running_mean, -0.5),
                (part.running_var, 0.5),
                (part.weight, 0.5),
                (part.bias, -0.5),
            ):
                tensor.data.copy_(low + torch.rand(tensor.shape, generator=generator))
    return module.eval()


@pytest.mark.parametrize(
    ("block", "shape", "expected"),
    [
        (ConvBlock(3, 5), (1, 3, 16, 24), (1, 5, 16, 24)),
        (ConvBlock(3, 5, 7, 2), (1, 3, 16, 24), (1, 5, 8, 12)),
        (ConvBlock(3, 5, 17, 8), (1, 3, 16, 24), (1, 5, 2, 3)),
        (ConvBlock3d(2, 4), (1, 2, 5, 8, 8), (1, 4, 5, 8, 8)),
        (DeconvBlock(4, 2, 8), (1, 4, 2, 3), (1, 2, 16, 24)),
        (Residual(4, 6), (1, 4, 8, 8), (1, 6, 8, 8)),
        (Hourglass(4, 3), (1, 4, 16, 24), (1, 4, 16, 24)),
    ],
)
def test_shape_and_fold(block: nn.Module, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
    x = torch.randn(shape, generator=torch.Generator().manual_seed(1))
    with_used_norms(block)
    with torch.inference_mode():
        before = block(x)
        fold_batch_norms(block)
        after = channels_last(block)(x)
    assert tuple(before.shape) == expected
    assert not any(isinstance(part, nn.BatchNorm2d | nn.BatchNorm3d) for part in block.modules())
    assert torch.allclose(before, after, atol=FOLD_TOLERANCE)


def test_fold_refuses_training_mode() -> None:
    with pytest.raises(ValueError, match="training mode"):
        fold_batch_norms(ConvBlock(3, 4))


def test_initial_weights_keep_the_variance() -> None:
    torch.manual_seed(0)
    layers = nn.Sequential(*(nn.Sequential(nn.Conv2d(32, 32, 3, padding=1), nn.PReLU(32)) for _ in range(8)))
    initialise(layers)
    with torch.inference_mode():
        out = layers(torch.randn(2, 32, 32, 32))
    assert 0.3 < float(out.std()) < 3.0
