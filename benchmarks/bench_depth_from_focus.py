"""Error and time of every classical depth from focus on generated stacks whose frame in focus is known.

Run: ``LFSTEREO_DATA=FOLDER python benchmarks/bench_depth_from_focus.py``, with ``focal/corentincou_gen`` in the folder
(CONTRIBUTING.md tells where it comes from): stacks of 41 frames of 400 x 400 px. All methods are timed in the same run,
so their ratios hold on a busy machine too.
"""

from __future__ import annotations

import os
import pickle
import sys
import time
from pathlib import Path

import numpy as np

from lfstereo.focus.importers import read_sweep
from lfstereo.focus.measures import METHODS, FocusOptions, find_focus

MARGIN_PX = 20
SIDE_PX = 359


class Arrays(pickle.Unpickler):
    """Reads the truth, which comes as a pickle, and refuses everything in it but arrays."""

    def find_class(self, module: str, name: str) -> object:
        """Return what an array is built from."""
        if module.split(".")[0] == "numpy" and name in ("_reconstruct", "ndarray", "dtype"):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name}: expected an array and nothing else")


def main() -> None:
    """Print one line per method."""
    if not os.environ.get("LFSTEREO_DATA"):
        sys.exit("LFSTEREO_DATA names no folder; set it to the folder that holds focal/corentincou_gen")
    folder = Path(os.environ["LFSTEREO_DATA"]) / "focal" / "corentincou_gen"
    inner = np.s_[MARGIN_PX : MARGIN_PX + SIDE_PX, MARGIN_PX : MARGIN_PX + SIDE_PX]
    scenes = []
    for scene in sorted(path for path in folder.iterdir() if path.is_dir()):
        with (scene / "reference.pkl").open("rb") as file:
            scenes.append((read_sweep(scene).slices, -np.asarray(Arrays(file).load())))
    candidates = {method: FocusOptions(method=method) for method in METHODS}
    candidates = {"nayar1992, window 3": FocusOptions(method="nayar1992", window_px=3)} | candidates
    find_focus(scenes[0][0][:3, :50, :50], FocusOptions(method="moeller2015"))  # compiles
    print(f"{len(scenes)} stacks of {scenes[0][0].shape[0]} frames; error in frames over all px of known truth")
    print(f"{'method':<22}{'median':>8}{'mean':>8}{'> 1':>8}{'> 3':>8}{'sure':>8}{'seconds':>9}{'ratio':>7}")
    first = 0.0
    for name, options in candidates.items():
        errors, sure, started = [], [], time.perf_counter()
        for slices, truth in scenes:
            found = find_focus(slices, options)
            errors.append(np.abs(found.slice_index[inner] - truth).ravel())
            sure.append(found.valid[inner].mean())
        seconds = (time.perf_counter() - started) / len(scenes)
        first = first or seconds
        error = np.concatenate(errors)
        off = "".join(f"{np.mean(error > limit):>8.2%}" for limit in (1, 3))
        print(
            f"{name:<22}{np.median(error):>8.3f}{error.mean():>8.3f}{off}{np.mean(sure):>8.1%}"
            f"{seconds:>9.2f}{seconds / first:>7.1f}"
        )


if __name__ == "__main__":
    main()
