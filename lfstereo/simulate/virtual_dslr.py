"""Virtual DSLR: a focal stack from one sharp image and its disparity.

References
----------
Yang, Lin, Yu, Paris, Yu, "Virtual DSLR: high quality dynamic depth-of-field synthesis on mobile platforms" (2016):
integration over the lens without storing a light field. Takeda, Hiura, Sato, "Fusing depth from defocus and stereo
with coded apertures" (2013): the blur diameter is linear in disparity.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float32, Float64, Rgb, check_shape
from lfstereo.errors import ConfigError, InputError
from lfstereo.focus.stack import FocalStack
from lfstereo.options import option
from lfstereo.progress import Progress, silent
from lfstereo.simulate.lens_warp import integrate_lens


@dataclass(frozen=True, slots=True)
class VirtualDslrOptions:
    """How the lens is sampled and how noisy the sensor is."""

    lens_samples: int = option(48, "points of the lens that each slice averages")
    noise: bool = option(True, "add photon and read noise to every slice")
    peak_photons: float = option(1000.0, "photons of a white pixel: fewer are noisier")
    read_noise: float = option(0.005, "standard deviation of the read noise, of white")
    seed: int = option(0, "decides the noise")
    threads: int = option(0, "slices rendered at a time; 0: one per processor core")


def virtual_dslr(
    image_linear: Rgb,
    disparity: Float32,
    focus_disparities: Float32,
    aperture_ratio: float,
    options: VirtualDslrOptions = VirtualDslrOptions(),
    progress: Progress = silent,
    source: str = "virtual DSLR",
) -> FocalStack:
    """Photograph a picture of known disparity at each focus with a lens of the given aperture.

    Parameters
    ----------
    image_linear
        ``(H, W, 3)`` linear RGB, 1.0 = white, everything sharp; beyond its frame it goes on mirrored.
    disparity
        ``(H, W)`` px, known everywhere; larger is nearer. Any sign: only differences from the focus matter.
    focus_disparities
        ``(K,)`` px, falling from near to far; any number of slices.
    aperture_ratio
        Aperture over baseline, D/B: a point at disparity d is blurred to a disc of diameter
        :func:`blur_diameter_px` in the slice focused at d_k.
    options
        Lens sampling and noise.
    progress
        Told the slices done.
    source
        Name of the stack, for messages.

    Returns
    -------
    FocalStack
        ``(K, H, W, 3)`` linear RGB; noise may make values slightly negative or larger than white.

    Raises
    ------
    ShapeError
        If the arrays do not fit together, or the focus disparities do not fall.
    ConfigError
        If the aperture ratio or an option is not possible.
    InputError
        If a disparity or a pixel is not finite.

    Examples
    --------
    A surface in focus stays as it is.

    >>> picture = np.random.default_rng(0).random((8, 9, 3), dtype=np.float32)
    >>> clean = VirtualDslrOptions(noise=False)
    >>> stack = virtual_dslr(picture, np.full((8, 9), 30, np.float32), np.float32([50, 30]), 0.2, clean)
    >>> float(np.abs(stack.slices[1] - picture).max()) < 1e-6
    True
    """
    _check(image_linear, disparity, focus_disparities, aperture_ratio, options, source)
    height, width = disparity.shape
    points = lens_points(options.lens_samples) * (aperture_ratio / 2)
    largest = float(np.abs(np.subtract.outer(focus_disparities, (disparity.min(), disparity.max()))).max())
    margin = int(np.ceil(np.abs(points).max() * largest)) + 2
    picture = np.pad(np.asarray(image_linear, np.float32), ((margin, margin), (margin, margin), (0, 0)), "symmetric")
    depth = np.pad(np.asarray(disparity, np.float32), margin, "symmetric")
    reach = int(np.ceil(aperture_ratio * float(np.ptp(disparity)))) + 4
    slices = np.empty((len(focus_disparities), height, width, 3), np.float32)

    def expose(k: int) -> None:
        total = np.zeros_like(picture)
        integrate_lens(picture, depth, points, float(focus_disparities[k]), reach, total)
        slices[k] = total[margin : margin + height, margin : margin + width] / np.float32(len(points))
        if options.noise:
            add_noise(slices[k], options, np.random.default_rng([options.seed, k]))

    with ThreadPoolExecutor(options.threads or os.cpu_count()) as pool:
        for done, _ in enumerate(pool.map(expose, range(len(slices)))):
            progress(done + 1, len(slices))
    return FocalStack(slices, np.asarray(focus_disparities, np.float32), aperture_ratio, source)


def blur_diameter_px(disparity: float, focus: float, aperture_ratio: float) -> float:
    """Return the diameter in px of the disc that a point is blurred to.

    References
    ----------
    Takeda, Hiura, Sato, "Fusing depth from defocus and stereo with coded apertures" (2013): blur and disparity
    are proportional, with the ratio of aperture to baseline.

    Examples
    --------
    >>> blur_diameter_px(70.0, 20.0, 0.1)
    5.0
    """
    return aperture_ratio * abs(disparity - focus)


def lens_points(count: int) -> Float64:
    """Spread points evenly over the unit disc, centred and with the disc's own second moment.

    Returns
    -------
    Float64
        ``(count, 2)``, mean 0, mean squared radius 1/2.

    References
    ----------
    Vogel, "A better way to construct the sunflower head" (1979), eq. 1.

    Examples
    --------
    >>> points = lens_points(48)
    >>> round(float((points**2).sum(1).mean()), 6)
    0.5
    """
    index = np.arange(count)
    radius, angle = np.sqrt((index + 0.5) / count), index * np.pi * (3 - np.sqrt(5.0))
    points = np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
    points -= points.mean(0)
    spread = (points**2).sum(1).mean()
    return np.asarray(points * np.sqrt(0.5 / spread) if spread > 0 else points, np.float64)


def add_noise(linear: Float32, options: VirtualDslrOptions, rng: np.random.Generator) -> None:
    """Replace light by a count of photons plus read noise, in place: variance ``I / peak + read**2``.

    Parameters
    ----------
    linear
        ``(..., 3)`` float32 linear light, 1.0 = white.
    options
        Photons of a white pixel, read noise.
    rng
        Draws the noise.
    """
    photons = rng.poisson(np.maximum(linear, 0) * options.peak_photons)
    linear[:] = photons / options.peak_photons
    linear += np.float32(options.read_noise) * rng.standard_normal(linear.shape, dtype=np.float32)


def _check(
    image: Rgb,
    disparity: Float32,
    focus_disparities: Float32,
    aperture_ratio: float,
    options: VirtualDslrOptions,
    source: str,
) -> None:
    check_shape(f"{source}: image", image, (None, None, 3))
    check_shape(f"{source}: disparity", disparity, image.shape[:2])
    check_shape(f"{source}: focus disparities", np.asarray(focus_disparities), (None,))
    if not 0 <= aperture_ratio < 2:
        raise ConfigError(f"{source}: aperture_ratio = {aperture_ratio}, expected 0 to 2 (an Illum pair has about 0.1)")
    for name, value, least in (
        ("lens_samples", options.lens_samples, 1),
        ("peak_photons", options.peak_photons, 1e-3),
        ("read_noise", options.read_noise, 0),
        ("threads", options.threads, 0),
    ):
        if not least <= value < np.inf:
            raise ConfigError(f"{name} = {value}: expected {least:g} or more")
    for name, array in (("image", image), ("disparity", disparity)):
        if not np.isfinite(array).all():
            wrong = int((~np.isfinite(array)).sum())
            raise InputError(f"{source}: {wrong} values of the {name} are not finite; fill unknown pixels first")
