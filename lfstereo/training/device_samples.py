"""Stack samples rendered on the training device: what :mod:`lfstereo.training.samples` makes, in torch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfstereo.arrays import Bool, Float32
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.network.encoding import GAMMA, WHITE_PERCENTILE
from lfstereo.training import samples
from lfstereo.training.device_tracing import Frame, render_views
from lfstereo.training.rooms import SCENES
from lfstereo.training.samples import LEAST_BLUR_PX, PUPIL_POINTS, SLICE_DISPARITIES, pupil_points
from lfstereo.training.scenes import Scene

_DARK = 1e-5


@dataclass(frozen=True, slots=True)
class DeviceSample:
    """A pair of focal stacks on the device; fields as in :class:`lfstereo.training.samples.StackSample`."""

    stacks: Tensor
    """``(2, 16, 3, H, W)`` display-referred, 0 to 1."""
    sharp: Tensor
    """``(2, 3, H, W)``."""
    disparity: Tensor
    """``(2, H, W)`` px."""
    valid: Tensor
    """``(2, H, W)`` bool."""


@dataclass(frozen=True, slots=True)
class Faults:
    """What is wrong with the two cameras of a sample."""

    aperture_ratio: float
    gains: tuple[Float32, Float32]
    """Exposure of the channels, ``(3,)`` for each eye."""
    shift_y: tuple[float, float]
    """px by which each picture lies too low."""
    peak: float
    """Photons of white in one view."""
    read: float
    """Standard deviation of the read noise, of white 1."""
    turns_rad: tuple[float, float]
    """Turn of each eye's pupil points."""
    blur_px: float
    margins: Bool
    """``(2, H, W)``, false in black borders."""


def draw_faults(rng: np.random.Generator, height: int, width: int) -> Faults:
    """Draw the faults of a sample of this size."""
    peak, read = samples.draw_noise(rng)
    return Faults(
        aperture_ratio=samples.draw_aperture_ratio(rng),
        gains=(np.ones(3, np.float32), samples.draw_gain(rng)),
        shift_y=(0.0, samples.draw_misalignment(rng)),
        peak=peak,
        read=read,
        turns_rad=(float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0, 2 * np.pi))),
        blur_px=samples.draw_blur_px(rng),
        margins=samples.draw_margins(rng, height, width),
    )


@torch.no_grad()
def device_stack_sample(
    seed: tuple[int, ...], textures: Tensor, bank: Float32, height: int, width: int, kind: str = "layers"
) -> DeviceSample:
    """Render a pair of focal stacks focused at 100 to 0 px.

    Parameters
    ----------
    seed
        Decides everything.
    textures
        ``(N, 256, 256, 3)`` on the device.
    bank
        The same textures on the host; only their number is used there.
    height, width
        Size in px.
    kind
        Of scene, see :data:`lfstereo.training.rooms.SCENES`.
    """
    rng = np.random.default_rng(seed)
    scene = SCENES[kind](rng, bank, height, width)
    faults = draw_faults(rng, height, width)
    noise = torch.Generator(textures.device).manual_seed(int(rng.integers(2**31)))
    eyes = [np.array([[eye, 0.0]], np.float32) for eye in (0, 1)]
    views = [
        render_views(scene.layers, textures, eyes[eye], Frame(height, width, 0, faults.shift_y[eye]), 4)
        for eye in (0, 1)
    ]
    exposure = _exposure([image for image, _ in views])
    gains = [torch.from_numpy(gain).to(textures.device) / exposure for gain in faults.gains]
    linear = [_stack(scene, textures, eye, faults, gains[eye], noise) for eye in (0, 1)]
    white = _exposure(linear)
    lit = torch.from_numpy(faults.margins).to(textures.device)
    stacks = torch.stack([_encode(_blur(s, faults.blur_px), white) for s in linear]) * lit[:, None, None]
    sharp = [
        _encode(_blur((image[0] * gain).movedim(-1, 0)[None], faults.blur_px)[0], white)
        for (image, _), gain in zip(views, gains, strict=True)
    ]
    disparity = torch.stack([d[0] for _, d in views])
    return DeviceSample(stacks, torch.stack(sharp) * lit[:, None], disparity, lit)


def _stack(scene: Scene, textures: Tensor, eye: int, faults: Faults, gain: Tensor, noise: torch.Generator) -> Tensor:
    """Linear focal stack ``(16, 3, H, W)``: noisy views from the pupil, sheared and averaged."""
    points = pupil_points(PUPIL_POINTS, faults.turns_rad[eye]) * np.float32(faults.aperture_ratio / 2)
    margin = int(np.ceil(np.abs(points).max() * DISPARITY_RANGE_PX)) + 2
    frame = Frame(scene.height, scene.width, margin, faults.shift_y[eye])
    views, _ = render_views(scene.layers, textures, points + np.array([eye, 0], np.float32), frame)
    views = views * gain
    grain = torch.randn(views.shape, generator=noise, device=views.device)
    views = views + torch.sqrt(views / faults.peak + faults.read**2) * grain
    return shear_mean(views.movedim(-1, 1), points, SLICE_DISPARITIES, margin)


def shear_mean(views: Tensor, points: Float32, disparities: Float32, margin: int) -> Tensor:
    """Average views so that each disparity in turn lines up.

    Parameters
    ----------
    views
        ``(P, 3, H + 2 margin, W + 2 margin)``.
    points
        ``(P, 2)`` where each view was taken, in baselines from the pupil's centre.
    disparities
        ``(K,)`` px of the slices.
    margin
        px, larger than any shift.

    Returns
    -------
    Tensor
        ``(K, 3, H, W)``.
    """
    _, _, rows, columns = views.shape
    height, width = rows - 2 * margin, columns - 2 * margin
    at = torch.from_numpy(points).to(views.device)[:, :, None, None]
    x = torch.arange(width, device=views.device, dtype=torch.float32)[None, None, :] + margin
    y = torch.arange(height, device=views.device, dtype=torch.float32)[None, :, None] + margin
    out = []
    for d in disparities:
        u = ((x - float(d) * at[:, 0]) * (2 / (columns - 1)) - 1).expand(-1, height, -1)
        v = ((y - float(d) * at[:, 1]) * (2 / (rows - 1)) - 1).expand(-1, -1, width)
        grid = torch.stack((u, v), dim=-1)
        out.append(F.grid_sample(views, grid, mode="bilinear", align_corners=True).mean(0))
    return torch.stack(out)


def _exposure(linear: list[Tensor]) -> Tensor:
    """The linear value that becomes 1.0; see :func:`lfstereo.network.encoding.exposure_of`."""
    values = torch.cat([image.flatten()[:: max(1, image.numel() // 2_000_000)] for image in linear])
    values = values[values > _DARK]
    if not values.numel():
        return torch.ones((), device=values.device)
    return torch.quantile(values, WHITE_PERCENTILE / 100).clamp(min=1e-4)


def _encode(linear: Tensor, exposure: Tensor) -> Tensor:
    return (linear / exposure).clamp(0, 1) ** (1 / GAMMA)


def _blur(image: Tensor, sigma: float) -> Tensor:
    """Gaussian blur of ``(N, 3, H, W)``."""
    if sigma < LEAST_BLUR_PX:
        return image
    radius = 4
    kernel = torch.exp(-0.5 * (torch.arange(-radius, radius + 1, device=image.device) / sigma) ** 2)
    kernel = (kernel / kernel.sum()).repeat(3, 1)
    image = F.pad(image, (radius, radius, radius, radius), mode="reflect")
    image = F.conv2d(image, kernel[:, None, None, :], groups=3)
    return F.conv2d(image, kernel[:, None, :, None], groups=3)
