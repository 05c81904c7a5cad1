"""Write a dual focal stack data set of generated scenes: exact views from points of each pupil, noise in every view."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfstereo.arrays import Float32
from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.errors import ConfigError
from lfstereo.focus.stack import FocalStack
from lfstereo.network.encoding import decode
from lfstereo.progress import Progress, silent
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stack_dataset import DualStack, Part, is_complete, open_dataset, write_dual_stack
from lfstereo.simulate.synthesis import SplitOptions, Synthesis
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions
from lfstereo.training.evaluate import HELD_OUT_SEED
from lfstereo.training.samples import SLICE_DISPARITIES, StackSample, stack_sample
from lfstereo.training.textures import texture_bank

_TEXTURES, _PER_BANK = 96, 64


def generate(
    root: Path,
    size: tuple[int, int],
    split: SplitOptions,
    options: PhotographOptions = PhotographOptions(),
    dslr: VirtualDslrOptions = VirtualDslrOptions(),
    progress: Progress = silent,
) -> Synthesis:
    """Render scenes and write them; scenes and textures of the test part never occur in the training part.

    Parameters
    ----------
    root
        Folder of the data set; scenes that are there already are kept.
    size
        Height and width in px.
    split
        Number of scenes in each part.
    options, dslr
        Aperture ratio and seed; the views are exact, so the lens sampling is not used.
    progress
        Told the scenes done.

    Raises
    ------
    ConfigError
        If other slices than 16 from 100 to 0 px, or stacks without noise are asked for.
    OutputError
        If a file cannot be written.
    """
    if (options.slices, options.near_px, options.far_px) != (SLICES_DEFAULT, DISPARITY_RANGE_PX, 0.0) or not dslr.noise:
        raise ConfigError(
            f"generated scenes: {options.slices} slices from {options.near_px:g} to {options.far_px:g} px, "
            f"noise {'on' if dslr.noise else 'off'}; "
            f"expected {SLICES_DEFAULT} slices from {DISPARITY_RANGE_PX:g} to 0 px with noise"
        )
    open_dataset(root, options, dslr)
    written: list[str] = []
    kept: list[str] = []
    counts: tuple[tuple[Part, int], ...] = (("train", split.train), ("test", split.test))
    for part, count in counts:
        seed = dslr.seed + (HELD_OUT_SEED if part == "test" else 0)
        bank, number = texture_bank(seed, 1), -1
        for index in range(count):
            name = f"generated-{part}-{index:05d}"
            if is_complete(root, part, name, options.slices, noisy=True):
                kept.append(f"{part}/{name}")
            else:
                if index // _PER_BANK != number:
                    number = index // _PER_BANK
                    bank = texture_bank(seed * 100003 + number, _TEXTURES)
                sample = stack_sample(np.random.default_rng([seed, 3, index]), bank, *size, options.aperture_ratio)
                write_dual_stack(root, part, dual_stack_of(name, sample), noisy=True)
                written.append(f"{part}/{name}")
            progress(len(written) + len(kept), split.train + split.test)
    return Synthesis(tuple(written), tuple(kept), ())


def dual_stack_of(name: str, sample: StackSample, foci: Float32 = SLICE_DISPARITIES) -> DualStack:
    """Bring a sample with slices at ``foci`` (px) to linear light; what lies outside 0 to 100 px is not known."""
    left, right = (
        FocalStack(decode(sample.stacks[eye], 1.0), foci, sample.aperture_ratio, f"{name} {side}")
        for eye, side in enumerate(("left", "right"))
    )
    sharp = decode(sample.sharp, 1.0)
    clipped: Float32 = np.clip(sample.disparity, 0, DISPARITY_RANGE_PX)
    known = sample.valid[0] & (clipped[0] == sample.disparity[0])
    return DualStack(name, left, right, sharp[0], sharp[1], clipped[0], known, clipped[1])
