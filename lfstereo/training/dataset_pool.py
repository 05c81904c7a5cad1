"""A pool cut from a dual focal stack data set, so that networks learn from pictures of one's own.

Run ``python -m lfstereo.training.dataset_pool DATA -o POOL`` and give the pool to ``lfstereo train --pool POOL``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfstereo.arrays import Bool, Float32
from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.errors import ConfigError, LfstereoError
from lfstereo.network.encoding import encode, exposure_of
from lfstereo.progress import Progress, progress_bar, silent
from lfstereo.simulate.stack_dataset import DualStack, list_dual_stacks, read_dual_stack, stack_folder
from lfstereo.training.pool import DISPARITY_STEPS_PER_PX, Pool, open_pool
from lfstereo.training.recipe import Recipe

_AGREE_PX = 1.0
"""Farther apart the two views' disparities are no truth of the right one."""


def fill_pool_from_dataset(pool: Pool, root: Path, seed: int, progress: Progress = silent) -> None:
    """Cut every sample that is not ready yet from the scenes of a data set's training part, in turn.

    Parameters
    ----------
    pool
        From :func:`lfstereo.training.pool.open_pool`.
    root
        Folder that ``lfstereo synthesize`` wrote; slices with noise are taken where there are some.
    seed
        Decides where the samples are cut out.

    Raises
    ------
    InputError
        If the folder holds no data set, or a file of it is damaged.
    ConfigError
        If the stacks are not focused as the networks expect, or the pictures are smaller than a sample.
    """
    noisy = stack_folder(root, True).is_dir()
    names = list_dual_stacks(root, "train", noisy)
    waiting = np.flatnonzero(pool.ready == 0)
    done = 0
    for number, name in enumerate(names):
        mine = waiting[number :: len(names)]
        if not len(mine):
            continue
        scene = read_dual_stack(root, "train", name, noisy)
        _check(scene, pool)
        for index in mine:
            _cut(pool, int(index), scene, np.random.default_rng([seed, 3, int(index)]))
            done += 1
            progress(done, len(waiting))


def _check(scene: DualStack, pool: Pool) -> None:
    foci = scene.left.disparities_px
    if len(foci) != SLICES_DEFAULT or (foci[0], foci[-1]) != (DISPARITY_RANGE_PX, 0):
        raise ConfigError(
            f"{scene.name}: {len(foci)} slices focused at {foci[0]:g} to {foci[-1]:g} px, expected {SLICES_DEFAULT} at "
            f"{DISPARITY_RANGE_PX:g} to 0; synthesize without --slices, --near-px and --far-px"
        )
    wanted, found = pool.disparity.shape[2:], scene.disparity.shape
    if found[0] < wanted[0] or found[1] < wanted[1]:
        raise ConfigError(
            f"{scene.name}: {found[1]} x {found[0]} px, expected at least the sample's {wanted[1]} x {wanted[0]}; give "
            "a smaller --height and --width, here and in the recipe"
        )


def _cut(pool: Pool, index: int, scene: DualStack, rng: np.random.Generator) -> None:
    height, width = pool.disparity.shape[2:]
    row = int(rng.integers(scene.disparity.shape[0] - height + 1))
    column = int(rng.integers(scene.disparity.shape[1] - width + 1))
    place = np.s_[row : row + height, column : column + width]
    stacks = np.stack([scene.left.slices[:, *place], scene.right.slices[:, *place]])
    sharp = np.stack([scene.sharp[place], scene.sharp_right[place]])
    white = exposure_of(stacks)
    pool.stacks[index] = np.round(encode(stacks, white) * 255)
    pool.sharp[index] = np.round(encode(sharp, white) * 255)
    disparity = np.stack([scene.disparity[place], scene.right_disparity[place]])
    pool.disparity[index] = np.round(np.clip(disparity, 0, 255) * DISPARITY_STEPS_PER_PX)
    pool.valid[index, 0] = scene.known[place]
    pool.valid[index, 1] = right_truth(scene.disparity, scene.known, scene.right_disparity)[place]
    pool.aperture_ratio[index] = scene.left.aperture_ratio
    pool.ready[index] = 1


def right_truth(disparity: Float32, known: Bool, right: Float32) -> Bool:
    """Return where the right view's disparity is confirmed by the left one's, ``(H, W)``.

    Examples
    --------
    >>> left = np.float32([[0, 0, 2, 2]])
    >>> right_truth(left, np.ones((1, 4), bool), np.float32([[2, 2, 0, 0]])).tolist()
    [[True, True, False, False]]
    """
    rows, columns = right.shape
    there = np.rint(np.arange(columns) + right).astype(np.intp)
    inside = there < columns
    at = np.clip(there, 0, columns - 1)
    row = np.arange(rows)[:, None]
    agreed: Bool = inside & known[row, at] & (np.abs(disparity[row, at] - right) <= _AGREE_PX)
    return agreed


def main(words: Sequence[str] | None = None) -> int:
    """Cut a pool from the command line."""
    usual = Recipe()
    parser = argparse.ArgumentParser(prog="python -m lfstereo.training.dataset_pool", description=__doc__)
    parser.add_argument("dataset", type=Path, help="folder that 'lfstereo synthesize' wrote")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the pool; a begun one goes on")
    for name, value in (("count", usual.pool_size), ("height", usual.height), ("width", usual.width)):
        parser.add_argument(f"--{name}", type=int, default=value, help="as in the recipes (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=usual.seed, help="as in the recipes (default: %(default)s)")
    arguments = parser.parse_args(words)
    try:
        pool = open_pool(arguments.output, arguments.count, arguments.height, arguments.width, arguments.seed)
        with progress_bar("cut samples") as progress:
            fill_pool_from_dataset(pool, arguments.dataset, arguments.seed, progress)
    except LfstereoError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(
        f"{arguments.output}: {len(pool.ready)} samples; give it to 'lfstereo train RECIPE --pool {arguments.output}'"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
