"""Write a dual focal stack data set from stereo scenes, going on where an earlier run ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfstereo.options import option
from lfstereo.progress import Progress, silent
from lfstereo.simulate.photograph import PhotographOptions, photograph_pair
from lfstereo.simulate.stack_dataset import DualStack, Part, is_complete, open_dataset, write_dual_stack
from lfstereo.simulate.stereo_scenes import SceneFiles, StereoScene, read_disparity, read_scene
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions


@dataclass(frozen=True, slots=True)
class SplitOptions:
    """How many scenes are for training and how many for tests."""

    train: int = option(750, "most scenes for training")
    test: int = option(160, "most scenes for tests")


@dataclass(frozen=True, slots=True)
class Synthesis:
    """What became of the scenes."""

    written: tuple[str, ...]
    """``part/name`` of the scenes written now."""
    kept: tuple[str, ...]
    """Scenes that an earlier run had written."""
    too_near: tuple[str, ...]
    """Frames left out because their largest disparity reaches the nearest slice."""


def synthesize(
    root: Path,
    scenes: Sequence[SceneFiles],
    options: PhotographOptions = PhotographOptions(),
    dslr: VirtualDslrOptions = VirtualDslrOptions(),
    split: SplitOptions = SplitOptions(),
    progress: Progress = silent,
) -> Synthesis:
    """Photograph scenes and write them, in an order that the seed decides.

    Scenes stay in the part (train, test) that their data set puts them in; others are divided in the ratio of
    ``split``. Frames of FlyingThings3D whose largest disparity reaches the nearest slice are left out.

    Raises
    ------
    ConfigError
        If the folder holds a data set of other options, or a scene that is no frame of FlyingThings3D is too near.
    InputError
        If a scene cannot be read.
    OutputError
        If a file cannot be written.

    References
    ----------
    Guo, Chen, Li, Yang, Yu, "Deep Eyes: Binocular Depth-from-Focus on Focal Stack Pairs" (2017): 750 frames of
    FlyingThings3D for training and 160 for tests, largest disparity below 100 px.
    """
    open_dataset(root, options, dslr)
    order = np.random.default_rng(dslr.seed).permutation(len(scenes))
    placed = [(scenes[i], part) for i, part in zip(order, parts_of([scenes[i] for i in order], split), strict=True)]
    room = {"train": split.train, "test": split.test}
    total = sum(min(room[p], sum(part == p for _, part in placed)) for p in room)
    written: list[str] = []
    kept: list[str] = []
    too_near: list[str] = []
    for files, part in placed:
        if not room[part]:
            continue
        label = f"{part}/{files.name}"
        if is_complete(root, part, files.name, options.slices, dslr.noise):
            kept.append(label)
        elif files.part and _largest(files) >= options.near_px:
            too_near.append(label)
            continue
        else:
            write_dual_stack(root, part, photograph(read_scene(files), options, dslr), dslr.noise)
            written.append(label)
        room[part] -= 1
        progress(len(written) + len(kept), total)
    return Synthesis(tuple(written), tuple(kept), tuple(too_near))


def photograph(scene: StereoScene, options: PhotographOptions, dslr: VirtualDslrOptions) -> DualStack:
    """Photograph both views of one scene."""
    left, right = photograph_pair(scene, options, dslr)
    return DualStack(
        scene.name, left, right, scene.left, scene.right, scene.disparity, scene.known, scene.right_disparity
    )


def parts_of(scenes: Sequence[SceneFiles], split: SplitOptions) -> list[Part]:
    """Return the part of each scene: its own, or else one in the ratio of ``split``, evenly spread.

    Examples
    --------
    >>> files = [SceneFiles(n, Path(), Path(), Path()) for n in "abcd"]
    >>> parts_of(files, SplitOptions(train=3, test=1))
    ['train', 'train', 'train', 'test']
    """
    both = max(split.train + split.test, 1)
    found: list[Part] = []
    free = 0
    for scene in scenes:
        if scene.part:
            found.append(scene.part)
        else:
            free += 1
            found.append("test" if free * split.test // both > (free - 1) * split.test // both else "train")
    return found


def frames_for_tests(scenes: Sequence[SceneFiles], near_px: float, split: SplitOptions, seed: int) -> list[SceneFiles]:
    """Return the scenes to test on: all, but of FlyingThings3D only what :func:`synthesize` would put into ``test``."""
    chosen = [scene for scene in scenes if scene.part is None]
    room = split.test
    for i in np.random.default_rng(seed).permutation(len(scenes)):
        if room and scenes[i].part == "test" and _largest(scenes[i]) < near_px:
            chosen.append(scenes[i])
            room -= 1
    return chosen


def _largest(files: SceneFiles) -> float:
    disparity, known = read_disparity(files.disparity, files.scale)
    return float(disparity[known].max()) if known.any() else 0.0
