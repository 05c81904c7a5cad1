"""What the binocular network makes of each cue, of any number of slices, and how well it knows its errors.

Run: ``python benchmarks/bench_binocular.py [--model NAME] [SCENES ...]``. ``SCENES`` are Middlebury folders, as for
``lfstereo evaluate``: they are photographed by the virtual camera, and the errors with both cues are set against those
with either taken away, also on plain surfaces. With ``LFSTEREO_DATA`` it also reads ``lf/hci_antinous`` and
``focal/corentincou_gen`` (one stack alone; tests/DATA.md tells where they come from). Rendered light fields of seeds
that training never saw are always there: 8 to 64 slices of the same views.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import torch

from lfstereo.depth.pfm import read_pfm
from lfstereo.focus.measures import FocusOptions, find_focus
from lfstereo.focus.refocus import refocus
from lfstereo.focus.slope_map import find_focus_range
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.views_folder import read_light_field
from lfstereo.network.binocular_net import BinocularNet
from lfstereo.network.encoding import encode, exposure_of
from lfstereo.network.estimate import (
    Network,
    binocular_map,
    encoded_stack,
    estimate_disparity,
    estimate_from_one_stack,
    load_network,
)
from lfstereo.network.shipped import DEFAULT_MODEL
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stereo_scenes import find_scenes
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions
from lfstereo.training.atlas import mixed_bank
from lfstereo.training.comparison import photographed_cases
from lfstereo.training.evaluate import ABLATIONS, HELD_OUT_SEED
from lfstereo.training.generated_dataset import dual_stack_of
from lfstereo.training.samples import stack_sample

sys.path.insert(0, str(Path(__file__).parent))
from bench_depth_from_focus import corentincou

PLAIN_GRADIENT = 0.01
"""Mean gradient (display-referred, per px, over 15 px) below which a surface counts as plain."""
SLICE_COUNTS = (8, 16, 32, 64)
RENDERED, RENDERED_SIZE = 4, (256, 448)


def cues(folders: list[Path], ratio: float, network: Network) -> None:
    """Compare both cues with either alone, on photographs and on their plain surfaces."""
    assert isinstance(network.module, BinocularNet)
    scenes = [scene for folder in folders for scene in find_scenes(folder, None)]
    errors: dict[str, list[np.ndarray]] = {name: [] for name in ABLATIONS}
    plain, foretold = [], []
    options = PhotographOptions(aperture_ratio=ratio)
    for case in photographed_cases(scenes, options, VirtualDslrOptions()):
        exposure = exposure_of(case.left.slices, case.right.slices)
        left, right = (encoded_stack(stack, exposure, network) for stack in (case.left, case.right))
        foci = torch.from_numpy(np.asarray(case.left.disparities_px, np.float32))
        for name, (other, use_focus) in zip(ABLATIONS, ((right, True), (right, False), (None, True)), strict=True):
            with torch.inference_mode():
                refined, front = network.module(left, other, foci, use_focus)
            found = binocular_map(refined, front, case.disparity.shape, 1.0)
            errors[name].append(np.abs(found.disparity - case.disparity)[case.known])
            if name == ABLATIONS[0]:
                foretold.append(found.uncertainty_px[case.known])
        plain.append(plain_surfaces(encode(case.sharp, exposure))[case.known])
    print(f"\n{len(scenes)} photographed scenes, D/B = {ratio}: mean over scenes; {share(plain):.0%} are plain")
    print(f"{'':<18}{'MAE px':>8}{'bad 2':>8}{'plain: MAE':>12}{'bad 2':>8}")
    for name, found in errors.items():
        on_plain = [e[p] for e, p in zip(found, plain, strict=True) if p.any()]
        figures = [mean(found), bad(found), mean(on_plain), bad(on_plain)]
        print(f"{name:<18}{figures[0]:>8.3f}{figures[1]:>8.1%}{figures[2]:>12.3f}{figures[3]:>8.1%}")
    sparsification(np.concatenate(errors[ABLATIONS[0]]), np.concatenate(foretold))


def sparsification(error: np.ndarray, foretold: np.ndarray) -> None:
    """Print the mean error of what is left when the pixels of largest foretold, and of largest true, error go."""
    shares = np.linspace(0, 0.95, 20)
    curves = []
    for order in (np.argsort(foretold), np.argsort(error)):
        kept = np.cumsum(error[order].astype(np.float64)) / np.arange(1, len(error) + 1)
        curves.append(kept[(len(error) * (1 - shares)).astype(int) - 1])
    random = float(error.mean())
    areas = [float(np.trapezoid(curve, shares)) / 0.95 for curve in curves]
    print(
        f"sparsification, area under the curve: foretold {areas[0]:.3f} px, ideal {areas[1]:.3f}, random {random:.3f}"
    )
    edges = np.quantile(foretold, np.linspace(0, 1, 6))
    bins = np.digitize(foretold, edges[1:-1])
    means = ", ".join(f"{foretold[bins == i].mean():.2f} -> {error[bins == i].mean():.2f}" for i in range(5))
    print(f"foretold -> true error [px], by fifths: {means}")


def slice_counts(network: Network) -> None:
    """Refocus the same views at more and fewer slices."""
    bank = mixed_bank(HELD_OUT_SEED, 96)
    print(f"\n{RENDERED} rendered light-field pairs, D/B = 0.15, slices of the same views: MAE px")
    for count in SLICE_COUNTS:
        foci = np.linspace(100, 0, count, dtype=np.float32)
        found = []
        for index in range(RENDERED):
            rng = np.random.default_rng([HELD_OUT_SEED, 5, index])
            sample = stack_sample(rng, bank, *RENDERED_SIZE, 0.15, "rooms", foci)
            case = dual_stack_of("rendered", sample, foci)
            result = estimate_disparity(case.left, case.right, network)
            found.append(np.abs(result.disparity - case.disparity)[case.known])
        print(f"{count:>4} slices: {mean(found):.3f}, off by > 2 px {bad(found):.1%}")


def one_stack(root: Path, network: Network) -> None:
    """Depth from focus by the network and by the classical methods."""
    folder = root / "lf" / "hci_antinous"
    truth, _ = read_pfm(folder / "gt_disp_lowres.pfm")
    field = read_light_field(folder)
    limits = find_focus_range(field)
    slopes = np.linspace(limits.near, limits.far, 33)
    slices = refocus(field, slopes)
    stack = FocalStack(slices, slopes.astype(np.float32), 0.0, "antinous")
    print("\nhci_antinous, one stack of 33 slices from 9 x 9 views: disparity per view")
    answers = {"network, one stack": estimate_from_one_stack(stack, network).disparity}
    for method in ("min2014", "moeller2015"):
        index = find_focus(slices, FocusOptions(method=method)).slice_index
        answers[method] = np.interp(index, np.arange(33), slopes)
    for name, answer in answers.items():
        error = np.abs(answer - truth)[15:-15, 15:-15]
        print(f"{name:<22} MAE {error.mean():.3f}, bad 0.07 {np.mean(error > 0.07):.1%}")
    print("\ncorentincou_gen, 3 stacks of 41 frames: error in frames")
    scenes = corentincou(root / "focal" / "corentincou_gen")
    found = {"network, one stack": [], "min2014": []}
    for slices, truth, known in scenes:
        stack = FocalStack(slices, -np.arange(len(slices), dtype=np.float32), 0.0, "corentincou")
        found["network, one stack"].append(np.abs(-estimate_from_one_stack(stack, network).disparity - truth)[known])
        found["min2014"].append(np.abs(find_focus(slices, FocusOptions(method="min2014")).slice_index - truth)[known])
    for name, parts in found.items():
        error = np.concatenate(parts)
        print(f"{name:<22} median {np.median(error):.3f}, off by > 1 frame {np.mean(error > 1):.2%}")


def speed(network: Network) -> None:
    """Time a pair of stacks of 640 x 432 px."""
    rng = np.random.default_rng(0)
    picture = cv2.GaussianBlur(rng.random((432, 640, 3), dtype=np.float32), (0, 0), 2)
    stack = FocalStack(np.repeat(picture[None], 16, 0), np.linspace(100, 0, 16, dtype=np.float32), 0.1, "speed")
    spent = []
    for _ in range(4):
        started, cpu = time.perf_counter(), time.process_time()
        estimate_disparity(stack, stack, network)
        spent.append((time.perf_counter() - started, time.process_time() - cpu))
    parameters = sum(p.numel() for p in network.module.parameters())
    wall, cpu = min(spent[1:])
    print(f"\n{parameters / 1e6:.2f} M parameters; 640 x 432 px, 16 slices, both eyes: {wall:.2f} s, {cpu:.2f} CPU s")


def plain_surfaces(picture: np.ndarray) -> np.ndarray:
    """Return where a picture's gradient is small all around."""
    grey = picture.mean(2)
    gradient = np.abs(cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=1 / 8)) + np.abs(
        cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=1 / 8)
    )
    return cv2.blur(gradient, (15, 15)) < PLAIN_GRADIENT


def mean(parts: list[np.ndarray]) -> float:
    """Mean over scenes of the mean error."""
    return float(np.mean([part.mean() for part in parts]))


def bad(parts: list[np.ndarray]) -> float:
    """Mean over scenes of the share of pixels off by more than 2 px."""
    return float(np.mean([np.mean(part > 2) for part in parts]))


def share(masks: list[np.ndarray]) -> float:
    """Mean over scenes of the share of pixels in a mask."""
    return float(np.mean([mask.mean() for mask in masks]))


def main() -> None:
    """Print every table that can be had."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--model", default=DEFAULT_MODEL)
    parser.add_argument("--aperture-ratio", type=float, nargs="+", default=[0.1, 0.35])
    arguments = parser.parse_args()
    network = load_network(arguments.model, "cpu")
    speed(network)
    slice_counts(network)
    if named := os.environ.get("LFSTEREO_DATA"):
        one_stack(Path(named), network)
    for ratio in arguments.aperture_ratio if arguments.scenes else ():
        cues(arguments.scenes, ratio, network)


if __name__ == "__main__":
    main()
