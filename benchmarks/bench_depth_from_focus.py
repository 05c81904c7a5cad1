"""Error and time of every classical depth from focus on stacks whose slice in focus is known.

Run: ``python benchmarks/bench_depth_from_focus.py``. With ``LFSTEREO_DATA`` naming a folder that holds
``focal/corentincou_gen`` (tests/DATA.md tells where it comes from) it first reads those: 41 frames of 400 x 400 px.
All methods are timed in the same run, so their ratios hold on a busy machine too.
"""

from __future__ import annotations

import os
import pickle
import time
from pathlib import Path

import numpy as np

from lfstereo.focus.importers import read_sweep
from lfstereo.focus.measures import METHODS, FocusOptions, find_focus
from lfstereo.training.comparison import synthetic_cases

MARGIN_PX = 20
SIDE_PX = 359
RENDERED, RENDERED_SIZE, SEED = 8, (192, 256), 77
Scene = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Slices, the slice in focus in truth, and where it is known."""


class Arrays(pickle.Unpickler):
    """Reads the truth, which comes as a pickle, and refuses everything in it but arrays."""

    def find_class(self, module: str, name: str) -> object:
        """Return what an array is built from."""
        if module.split(".")[0] == "numpy" and name in ("_reconstruct", "ndarray", "dtype"):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name}: expected an array and nothing else")


def corentincou(folder: Path) -> list[Scene]:
    """Read the generated stacks of frames that are textured everywhere."""
    scenes = []
    inner = np.s_[MARGIN_PX : MARGIN_PX + SIDE_PX, MARGIN_PX : MARGIN_PX + SIDE_PX]
    for path in sorted(path for path in folder.iterdir() if path.is_dir()):
        with (path / "reference.pkl").open("rb") as file:
            truth = -np.asarray(Arrays(file).load())
        slices = read_sweep(path).slices
        wide, known = np.zeros(slices.shape[1:3]), np.zeros(slices.shape[1:3], bool)
        wide[inner], known[inner] = truth, True
        scenes.append((slices, wide, known))
    return scenes


def rendered() -> list[Scene]:
    """Render scenes with depth edges, bare surfaces and noise."""
    scenes = []
    for case in synthetic_cases(RENDERED, *RENDERED_SIZE, None, SEED):
        focused = case.left.disparities_px
        truth = (focused[0] - case.disparity) / (focused[0] - focused[1])
        scenes.append((case.left.slices, truth, case.known))
    return scenes


def table(title: str, scenes: list[Scene]) -> None:
    """Print one line per method."""
    candidates = {"nayar1992, window 3": FocusOptions(method="nayar1992", window_px=3)}
    candidates |= {method: FocusOptions(method=method) for method in METHODS}
    find_focus(scenes[0][0][:3, :50, :50], FocusOptions(method="moeller2015"))  # compiles
    print(f"{title}: {len(scenes)} stacks of {len(scenes[0][0])}; error in slices; 'sure': of the pixels so marked")
    print(f"{'method':<22}{'median':>8}{'mean':>8}{'> 1':>8}{'sure':>8}{'> 1':>8}{'seconds':>9}{'ratio':>7}")
    first = 0.0
    for name, options in candidates.items():
        found, started = [], time.perf_counter()
        for slices, _, _ in scenes:
            found.append(find_focus(slices, options))
        seconds = (time.perf_counter() - started) / len(scenes)
        first = first or seconds
        pairs = list(zip(found, scenes, strict=True))
        error = np.concatenate([np.abs(f.slice_index - truth)[known] for f, (_, truth, known) in pairs])
        sure = np.concatenate([f.valid[known] for f, (_, _, known) in pairs])
        print(
            f"{name:<22}{np.median(error):>8.3f}{error.mean():>8.3f}{np.mean(error > 1):>8.2%}{sure.mean():>8.1%}"
            f"{np.mean(error[sure] > 1):>8.2%}{seconds:>9.2f}{seconds / first:>7.1f}"
        )


def main() -> None:
    """Print a table for each kind of stacks that can be had."""
    named = os.environ.get("LFSTEREO_DATA")
    if named:
        table("corentincou_gen", corentincou(Path(named) / "focal" / "corentincou_gen"))
    table("rendered", rendered())


if __name__ == "__main__":
    main()
