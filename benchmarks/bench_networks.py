"""Speed of every network on two stacks of 16 slices: seconds, multiply-adds, and their share of what matrices reach.

Run ``python benchmarks/bench_networks.py [--size 544 960] [--device cuda]``. Both views are given, so the published
networks make two sharp images and one fused map. Widths R32 have new weights: they are as fast as trained ones.
Multiply-adds are counted by torch in convolutions and matrix products; the compiled aggregation of the binocular
network is none of them. The peak is that of a product of two float32 matrices of 4096 x 4096, measured in the same run.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch.utils.flop_counter import FlopCounterMode

from lfstereo.conventions import SLICES_DEFAULT
from lfstereo.network.bdff_net import Architecture, paper_architecture
from lfstereo.network.binocular_net import MULTIPLE, BinocularNet
from lfstereo.network.blocks import channels_last, fold_batch_norms
from lfstereo.network.estimate import load_network
from lfstereo.network.families import AnyArchitecture, AnyNetwork, build
from lfstereo.network.shipped import DEFAULT_MODEL

SIDE = 4096
NEAR_PX = 100.0
R32: dict[str, Any] = {"focus_width": 32, "edof_width": 32, "tail_width": 32, "stereo_width": 128}
DESCRIBED: dict[str, AnyArchitecture] = {
    "BDfF-Net R16 as published": paper_architecture(),
    "BDfF-Net R32": Architecture(**R32),
    "BDfF-Net R32 as published": Architecture(
        **R32, focus="branches", stereo="concat", residual=False, fusion_guide=False
    ),
}


def peak_gmac_s(device: str) -> float:
    """Return the multiply-adds of a large matrix product in G/s, best of five."""
    a, b = (torch.rand(SIDE, SIDE, device=device) for _ in range(2))
    return SIDE**3 / 1e9 / min(seconds_of(lambda: torch.mm(a, b), device) for _ in range(5))


def seconds_of(work: Callable[[], object], device: str) -> float:
    """Return the wall time of one call."""
    started = time.perf_counter()
    work()
    if device == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter() - started


def measure(name: str, module: AnyNetwork, size: tuple[int, int], device: str, rounds: int, peak: float) -> None:
    """Print one line; height and width are padded to the multiples that the network takes, as in use."""
    draw = torch.Generator().manual_seed(0)
    multiple = MULTIPLE if isinstance(module, BinocularNet) else module.architecture.multiple
    padded = [length + -length % multiple for length in size]
    left, right = (torch.rand(1, SLICES_DEFAULT, 3, *padded, generator=draw).to(device) for _ in range(2))
    foci = torch.from_numpy(np.linspace(NEAR_PX, 0, SLICES_DEFAULT, dtype=np.float32)).to(device)

    @torch.inference_mode()
    def run() -> None:
        module(left, right, foci) if isinstance(module, BinocularNet) else module(left, right, (0.0, NEAR_PX))

    with FlopCounterMode(display=False) as counter:
        run()
    gmac = counter.get_total_flops() / 2e9
    seconds = statistics.median(seconds_of(run, device) for _ in range(rounds))
    share = gmac / seconds / peak
    print(f"{name:<28}{seconds:>10.3f}{gmac:>9.1f}{gmac / seconds:>9.1f}{share:>8.0%}", flush=True)


def main() -> None:
    """Measure all networks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, nargs=2, default=(544, 960), metavar=("HEIGHT", "WIDTH"))
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    device, size = arguments.device, (arguments.size[0], arguments.size[1])
    peak = peak_gmac_s(device)
    print(f"2 stacks of {SLICES_DEFAULT} slices of {size[0]} x {size[1]} px, {device}; peak {peak:.0f} GMAC/s")
    print(f"{'':<28}{'seconds':>10}{'GMAC':>9}{'GMAC/s':>9}{'of peak':>8}")
    for name in ("bdffnet-r16-v1", DEFAULT_MODEL):
        measure(name, load_network(name, device).module, size, device, arguments.rounds, peak)
    for name, architecture in DESCRIBED.items():
        module = build(architecture).eval()
        fold_batch_norms(module)
        channels_last(module)
        measure(name, module.requires_grad_(False).to(device), size, device, arguments.rounds, peak)


if __name__ == "__main__":
    main()
