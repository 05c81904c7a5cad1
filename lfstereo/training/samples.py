"""Training samples: all-in-focus pairs and pairs of focal stacks, rendered from procedural scenes with known disparity.

The stacks are made as the cameras make them: true views from points of each pupil, noise in every view, shear and
average. The blur diameter is therefore ``a |d - d_k|`` px with exact occlusion, ``a`` the aperture ratio D/B.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64
from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.network.encoding import encode, exposure_of
from lfstereo.training.rooms import SCENES
from lfstereo.training.scenes import Scene, render

PUPIL_POINTS = 21
"""Points of each pupil that a stack averages."""
LEAST_BLUR_PX = 0.2
"""A weaker blur is left out."""
SLICE_DISPARITIES = np.linspace(DISPARITY_RANGE_PX, 0.0, SLICES_DEFAULT, dtype=np.float32)
"""``(16,)`` px, near to far."""


@dataclass(frozen=True, slots=True)
class PairSample:
    """Two all-in-focus images of a scene."""

    left: Float32
    """``(H, W, 3)`` display-referred RGB, 0 to 1."""
    right: Float32
    disparity: Float32
    """``(H, W)`` px of the left image, exact."""
    valid: Bool
    """``(H, W)``: false in the black margins of the left image."""


@dataclass(frozen=True, slots=True)
class StackSample:
    """Two focal stacks of a scene and what they should be turned into."""

    stacks: Float32
    """``(2, K, H, W, 3)`` left and right, display-referred RGB, 0 to 1."""
    sharp: Float32
    """``(2, H, W, 3)`` all-in-focus images without noise."""
    disparity: Float32
    """``(2, H, W)`` px, of the left and of the right image's own pixels."""
    valid: Bool
    """``(2, H, W)``: false in black margins."""
    aperture_ratio: float


def pupil_points(count: int, turn_rad: float = 0.0) -> Float32:
    """Spread points evenly over the unit disc.

    Returns
    -------
    Float32
        ``(count, 2)``; mean close to 0, radius below 1.

    References
    ----------
    Vogel, "A better way to construct the sunflower head" (1979), eq. 1.
    """
    index = np.arange(count)
    radius, angle = np.sqrt((index + 0.5) / count), index * np.pi * (3 - np.sqrt(5.0)) + turn_rad
    points = np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
    return np.asarray(points - points.mean(0), np.float32)


def pair_sample(
    rng: np.random.Generator, textures: Float32, height: int, width: int, kind: str = "layers"
) -> PairSample:
    """Render an all-in-focus pair with the faults of real cameras: noise, blur, unequal exposure, misalignment.

    ``kind`` names the scene, see :data:`lfstereo.training.rooms.SCENES`.
    """
    scene = SCENES[kind](rng, textures, height, width)
    left, right = render(scene, 0, 0, samples=2), render(scene, 1, 0, samples=2, shift_y=draw_misalignment(rng))
    images = [left.image, right.image * draw_gain(rng)]
    exposure, blur = exposure_of(*images), draw_blur_px(rng)
    peak, read = np.exp(rng.uniform(np.log(80), np.log(20000))), rng.uniform(0, 0.01)
    margin = draw_margins(rng, height, width)
    encoded = []
    for image, lit in zip(images, margin, strict=True):
        smooth = _blur(image, blur * rng.uniform(0.8, 1.2)) / exposure
        sigma = np.sqrt(np.maximum(smooth, 0) / peak + read**2)
        noisy = smooth + sigma * rng.standard_normal(smooth.shape, dtype=np.float32)
        encoded.append(encode(noisy.astype(np.float32), 1.0) * lit[..., None])
    return PairSample(encoded[0], encoded[1], left.disparity, margin[0])


def stack_sample(
    rng: np.random.Generator,
    textures: Float32,
    height: int,
    width: int,
    aperture_ratio: float | None = None,
    kind: str = "layers",
    foci: Float32 = SLICE_DISPARITIES,
) -> StackSample:
    """Render a pair of focal stacks.

    Parameters
    ----------
    rng
        Decides everything.
    textures
        ``(N, 256, 256, 3)`` bank.
    height, width
        Size in px.
    aperture_ratio
        Blur diameter per px of disparity; drawn from 0.05 to 0.4, mostly 0.08 to 0.2, where not given.
    kind
        Of scene, see :data:`lfstereo.training.rooms.SCENES`.
    foci
        ``(K,)`` disparities (px) of the slices, falling.
    """
    scene = SCENES[kind](rng, textures, height, width)
    ratio = aperture_ratio or draw_aperture_ratio(rng)
    gains, misalignment = (np.ones(3, np.float32), draw_gain(rng)), (0.0, draw_misalignment(rng))
    sharp_views = [render(scene, eye, 0, samples=4, shift_y=misalignment[eye]) for eye in (0, 1)]
    level = draw_noise(rng)
    exposure = exposure_of(*(v.image for v in sharp_views))
    noise = rng.standard_normal(6 * (height + 64) * (width + 64), dtype=np.float32)
    linear = [
        _stack(rng, scene, eye, ratio, misalignment[eye], gains[eye] / exposure, level, noise, foci) for eye in (0, 1)
    ]
    blur, margin = draw_blur_px(rng), draw_margins(rng, height, width)
    white = exposure_of(*linear)
    stacks = np.stack([[encode(_blur(s, blur), white) for s in stack] for stack in linear])
    sharp = [encode(_blur(v.image * gain / exposure, blur), white) for v, gain in zip(sharp_views, gains, strict=True)]
    lit = margin[..., None]
    disparity = np.stack([v.disparity for v in sharp_views])
    return StackSample(stacks * lit[:, None], np.stack(sharp) * lit, disparity, margin, ratio)


def _stack(
    rng: np.random.Generator,
    scene: Scene,
    eye: int,
    ratio: float,
    shift_y: float,
    gain: Float32,
    noise_level: tuple[float, float],
    noise: Float32,
    foci: Float32,
) -> Float32:
    from lfstereo.training.tracing import shear_add  # compiled, and only needed where scenes are rendered here

    points = pupil_points(PUPIL_POINTS, rng.uniform(0, 2 * np.pi)) * (ratio / 2)
    margin = int(np.ceil(np.abs(points).max() * DISPARITY_RANGE_PX)) + 2
    total = np.zeros((len(foci), scene.height, scene.width, 3), np.float32)
    peak, read = noise_level
    for x, y in points:
        view = render(scene, eye + float(x), float(y), margin=margin, shift_y=shift_y).image * gain
        start = int(rng.integers(0, noise.size - view.size))
        grain = noise[start : start + view.size].reshape(view.shape)
        view = (view + np.sqrt(view / peak + read**2) * grain).astype(np.float32)
        shear_add(view, foci * x, foci * y, margin, total)
    return total / np.float32(len(points))


def draw_noise(rng: np.random.Generator) -> tuple[float, float]:
    """Draw the photons of white in one view and the standard deviation of the read noise (of white 1)."""
    return float(np.exp(rng.uniform(np.log(20), np.log(3000)))), float(rng.uniform(0, 0.03))


def draw_aperture_ratio(rng: np.random.Generator) -> float:
    """Draw D/B: 0.05 to 0.4, mostly 0.08 to 0.2."""
    if rng.random() < 0.7:
        return float(rng.uniform(0.08, 0.2))
    return float(np.exp(rng.uniform(np.log(0.05), np.log(0.4))))


def draw_misalignment(rng: np.random.Generator) -> float:
    """Draw by how many px the right picture lies too low."""
    return float(rng.uniform(-0.5, 0.5))


def draw_gain(rng: np.random.Generator) -> Float32:
    """Draw the exposure of the right camera's channels relative to the left one's, ``(3,)``."""
    return np.asarray(rng.uniform(0.95, 1.05) * rng.uniform(0.98, 1.02, 3), np.float32)


def draw_blur_px(rng: np.random.Generator) -> float:
    """Draw the standard deviation (px) of the blur that lens and sampling add everywhere."""
    return float(rng.uniform(0.3, 0.9)) if rng.random() < 0.6 else 0.0


def _blur(image: Float32 | Float64, sigma: float) -> Float32:
    image = np.asarray(image, np.float32)
    if sigma < LEAST_BLUR_PX:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REFLECT), np.float32)


def draw_margins(rng: np.random.Generator, height: int, width: int) -> Bool:
    """Draw ``(2, height, width)``, false in black borders as a rectification leaves them.

    Each eye has slightly turned edges on some of its sides.
    """
    lit = np.ones((2, height, width), bool)
    if rng.random() < 0.65:
        return lit
    y, x = np.mgrid[0:height, 0:width]
    for eye in (0, 1):
        for side in range(4):
            if rng.random() < 0.5:
                continue
            across, along, size = (x, y, width) if side < 2 else (y, x, height)
            edge = rng.uniform(0, 0.1) * size + rng.uniform(-0.04, 0.04) * along
            lit[eye] &= (across >= edge) if side % 2 == 0 else (across < size - edge)
    return lit
