"""Measure every part of a model on rendered scenes that training never saw.

Run ``python -m lfstereo.training.evaluate bdffnet-r16-v1``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from lfstereo.arrays import Bool, Float32
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.network.binocular_net import BinocularNet
from lfstereo.network.estimate import load_network
from lfstereo.network.families import AnyNetwork
from lfstereo.progress import Progress, progress_bar, silent
from lfstereo.training.samples import SLICE_DISPARITIES, StackSample, stack_sample
from lfstereo.training.textures import texture_bank

HELD_OUT_SEED = 900_001
"""Scenes and textures of this seed are never trained on."""
BAD_PX = (1.0, 2.0, 4.0)
ABLATIONS = ("binocular", "without focus", "without stereo")
"""What the binocular network is given."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of one disparity map estimator over a set; all valid pixels count, occluded ones too."""

    part: str
    mae_px: float
    median_px: float
    bad: tuple[float, ...]
    """Share of pixels off by more than 1, 2, 4 px."""

    @property
    def mae_norm(self) -> float:
        """Mean absolute error in units of 100 px."""
        return self.mae_px / 100


def held_out(count: int, height: int, width: int, aperture_ratio: float | None, seed: int) -> list[StackSample]:
    """Render the samples to measure on."""
    textures = texture_bank(seed, 96)
    return [
        stack_sample(np.random.default_rng([seed, index]), textures, height, width, aperture_ratio)
        for index in range(count)
    ]


def evaluate(network: AnyNetwork, samples: Sequence[StackSample], progress: Progress = silent) -> list[Errors]:
    """Measure the maps of the left view that the network's parts make, and two references.

    ``constant`` answers the set's median everywhere; ``stereo_visible`` is ``stereo`` without pixels whose match lies
    outside the right image.
    """
    errors: dict[str, list[Float32]] = {}
    truth: list[Float32] = []
    network.eval()
    for index, sample in enumerate(samples):
        left, right = (_stack(sample.stacks[eye]) for eye in (0, 1))
        wanted, valid = sample.disparity[0], sample.valid[0]
        with torch.inference_mode():
            maps = _maps(network, left, right)
        for part, disparity in maps.items():
            error = np.abs(disparity - wanted)
            errors.setdefault(part, []).append(error[valid])
            if part in ("stereo", "fused", *ABLATIONS[:2]):
                errors.setdefault(f"{part}_visible", []).append(error[valid & _in_both(wanted)])
        truth.append(wanted[valid])
        progress(index + 1, len(samples))
    middle = np.float32(np.median(np.concatenate(truth)))
    errors["constant"] = [np.abs(t - middle) for t in truth]
    return [_errors(part, np.concatenate(parts)) for part, parts in errors.items()]


def edof_mae(network: AnyNetwork, samples: Sequence[StackSample]) -> tuple[float, float]:
    """Mean absolute error (0 to 1, display-referred) of EDoF-Net's image, and of the mean slice for comparison."""
    found, plain = [], []
    for sample in samples:
        stack = _stack(sample.stacks[0])
        wanted = torch.from_numpy(sample.sharp[0]).permute(2, 0, 1)[None]
        with torch.inference_mode():
            sharp = network.slices(stack).sharp if isinstance(network, BinocularNet) else network.edof(stack)
        found.append(float((sharp - wanted).abs().mean()))
        plain.append(float((stack.mean(1) - wanted).abs().mean()))
    return float(np.mean(found)), float(np.mean(plain))


def _maps(network: AnyNetwork, left: Tensor, right: Tensor) -> dict[str, Float32]:
    """Disparity maps in px, ``(H, W)``, by the part that made them."""
    if isinstance(network, BinocularNet):
        foci = torch.from_numpy(SLICE_DISPARITIES)
        seen = network.look(left, right, foci)
        fronts = [network.gather(seen, foci, *cues) for cues in ((True, True), (False, True), (True, False))]
        found = [network.refine(front.clues, front.offers).disparity[0, 0].numpy() for front in fronts]
        return dict(zip(ABLATIONS, found, strict=True))
    pair = network(left, right)
    parts = {"focus": pair.focus, "guided": pair.guided, "stereo": pair.stereo.final, "fused": pair.fused}
    if pair.stereo.joint is not None:
        parts["joint"] = pair.stereo.joint
    return {part: tensor[0, 0].numpy() * np.float32(DISPARITY_RANGE_PX) for part, tensor in parts.items()}


def _stack(slices: Float32) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(slices, np.float32)).permute(0, 3, 1, 2)[None]


def _in_both(disparity: Float32) -> Bool:
    return np.asarray(np.arange(disparity.shape[1])[None] - disparity >= 0)


def _errors(part: str, error: Float32) -> Errors:
    bad = tuple(float(np.mean(error > limit)) for limit in BAD_PX)
    return Errors(part, float(error.mean()), float(np.median(error)), bad)


def main(words: Sequence[str] | None = None) -> int:
    """Print a table of errors."""
    parser = argparse.ArgumentParser(prog="lfstereo.training.evaluate", description=__doc__)
    parser.add_argument("model", help="a shipped model's name, or a model folder")
    parser.add_argument("--count", type=int, default=40, help="scenes")
    parser.add_argument("--height", type=int, default=192, help="px, a multiple of 64")
    parser.add_argument("--width", type=int, default=320, help="px, a multiple of 64")
    parser.add_argument("--aperture-ratio", type=float, help="of all scenes; drawn from 0.05 to 0.4 where not given")
    parser.add_argument("--seed", type=int, default=HELD_OUT_SEED)
    arguments = parser.parse_args(words)
    network = load_network(arguments.model, "cpu").module
    samples = held_out(arguments.count, arguments.height, arguments.width, arguments.aperture_ratio, arguments.seed)
    with progress_bar("evaluate") as progress:
        rows = evaluate(network, samples, progress)
    print(f"{'part':<16}{'MAE/100':>9}{'MAE px':>9}{'median':>8}" + "".join(f"{f'bad{b:.0f}':>8}" for b in BAD_PX))
    for row in rows:
        bad = "".join(f"{100 * share:7.1f}%" for share in row.bad)
        print(f"{row.part:<16}{row.mae_norm:9.4f}{row.mae_px:9.2f}{row.median_px:8.2f}{bad}")
    found, plain = edof_mae(network, samples)
    print(f"edof            image MAE {found:.4f} (mean slice {plain:.4f})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
