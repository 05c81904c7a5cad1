"""Photograph both views of a stereo scene with the Virtual DSLR: a pair of focal stacks with known truth."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from lfstereo.arrays import Float32
from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.errors import ConfigError
from lfstereo.focus.stack import FocalStack
from lfstereo.options import option
from lfstereo.progress import Progress, silent
from lfstereo.simulate.stereo_scenes import StereoScene
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions, virtual_dslr


@dataclass(frozen=True, slots=True)
class PhotographOptions:
    """Focus range and lens of the pair of virtual cameras."""

    aperture_ratio: float = option(0.1, "aperture over baseline: blur diameter per px of disparity from the focus")
    slices: int = option(SLICES_DEFAULT, "slices of each stack")
    near_px: float = option(DISPARITY_RANGE_PX, "disparity of the nearest slice", "px")
    far_px: float = option(0.0, "disparity of the farthest slice", "px")


def focus_disparities(options: PhotographOptions) -> Float32:
    """Return ``(K,)`` evenly spaced focus disparities in px, near to far.

    Raises
    ------
    ConfigError
        If there is no slice, or the range does not fall.

    Examples
    --------
    >>> focus_disparities(PhotographOptions(slices=3)).tolist()
    [100.0, 50.0, 0.0]
    """
    if options.slices < 1 or not options.near_px > options.far_px:
        raise ConfigError(
            f"{options.slices} slices from {options.near_px} to {options.far_px} px: "
            "expected 1 slice or more, and near_px above far_px"
        )
    return np.linspace(options.near_px, options.far_px, options.slices, dtype=np.float32)


def photograph_pair(
    scene: StereoScene,
    options: PhotographOptions = PhotographOptions(),
    dslr: VirtualDslrOptions = VirtualDslrOptions(),
    progress: Progress = silent,
) -> tuple[FocalStack, FocalStack]:
    """Make the left and the right focal stack of a scene; the noise of each depends on the scene's name and the seed.

    Raises
    ------
    ConfigError
        If an option is not possible, or the scene is nearer than the nearest slice.
    """
    foci = focus_disparities(options)
    nearest = float(scene.disparity[scene.known].max())
    if nearest > options.near_px:
        raise ConfigError(
            f"{scene.name}: disparities up to {nearest:.1f} px, the nearest slice is focused at "
            f"{options.near_px:.1f} px; scale the pictures down, or give another scene"
        )
    stacks = []
    for eye, (picture, disparity) in enumerate(((scene.left, scene.disparity), (scene.right, scene.right_disparity))):
        seed = zlib.crc32(f"{dslr.seed} {eye} {scene.name}".encode())

        def eye_progress(done: int, total: int, eye: int = eye) -> None:
            progress(eye * total + done, 2 * total)

        name = f"{scene.name} {('left', 'right')[eye]}"
        own = replace(dslr, seed=seed)
        stacks.append(virtual_dslr(picture, disparity, foci, options.aperture_ratio, own, eye_progress, name))
    return stacks[0], stacks[1]
