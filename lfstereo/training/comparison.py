"""Compare every network of a model, and what a user without a network would run, on scenes of known disparity."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import nn

from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.depth.baselines import sgbm
from lfstereo.focus.measures import depth_from_focus
from lfstereo.network.binocular_net import BinocularNet
from lfstereo.network.encoding import decode, encode, exposure_of
from lfstereo.network.estimate import Network, binocular_map, check_stacks, cropped, encoded_stack
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stack_dataset import DualStack, read_dual_stack
from lfstereo.simulate.stereo_scenes import SceneFiles, read_scene
from lfstereo.simulate.synthesis import photograph
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions
from lfstereo.training.evaluate import ABLATIONS
from lfstereo.training.generated_dataset import dual_stack_of
from lfstereo.training.rows import Row, psnr_db, score_row, wls_filled
from lfstereo.training.samples import stack_sample
from lfstereo.training.textures import texture_bank

NETWORKS = ("Focus-Net", "Focus-Net-Guided", "Stereo-Net", "BDfF-Net")
BASELINES = ("SGBM", "SGBM+WLS filled", "depth from focus")
EDOF = "EDoF-Net"
SURE = "binocular, sure"
"""The same, judged where it does not expect an error above 4 px."""
WLS_ON_EDOF = "SGBM+WLS on EDoF"
"""Classical stereo on the two images of EDoF-Net: it sees no more than the networks do."""


def synthetic_cases(
    count: int, height: int, width: int, aperture_ratio: float | None, seed: int
) -> Iterator[DualStack]:
    """Render held-out scenes, one at a time; ``seed`` decides scenes and textures. Black margins do not count."""
    bank = texture_bank(seed, 96)
    for index in range(count):
        sample = stack_sample(np.random.default_rng([seed, index]), bank, height, width, aperture_ratio)
        yield dual_stack_of(f"synthetic-{index:03d}", sample)


def photographed_cases(
    scenes: Sequence[SceneFiles], options: PhotographOptions, dslr: VirtualDslrOptions
) -> Iterator[DualStack]:
    """Photograph stereo scenes with the Virtual DSLR, one at a time."""
    for files in scenes:
        yield photograph(read_scene(files), options, dslr)


def dataset_cases(
    root: Path, names: Sequence[str], noisy: bool, lens: PhotographOptions | None, far_first: bool
) -> Iterator[DualStack]:
    """Read scenes of the test part of a dual focal stack data set, one at a time."""
    for name in names:
        yield read_dual_stack(root, "test", name, noisy, lens, far_first)


def compare(case: DualStack, network: Network | None) -> list[Row]:
    """Judge every method on one scene.

    The stereo baselines get the sharp views without noise, which is more than the networks get; what SGBM leaves
    open is not judged and lowers its density, all others answer everywhere.

    Raises
    ------
    ShapeError, ConfigError
        If the network cannot use the stacks.
    """
    rows = [] if network is None else _network_rows(case, network)
    near = float(case.left.disparities_px[0])
    started = time.perf_counter()
    plain = sgbm(case.sharp, case.sharp_right, near)
    rows.append(score_row(case, BASELINES[0], plain.disparity, time.perf_counter() - started, plain.valid))
    started = time.perf_counter()
    filled = wls_filled(case.sharp, case.sharp_right, near)
    rows.append(score_row(case, BASELINES[1], filled.disparity, time.perf_counter() - started, filled.valid))
    started = time.perf_counter()
    focused = depth_from_focus(case.left)
    rows.append(score_row(case, BASELINES[2], focused.disparity, time.perf_counter() - started))
    return rows


def _network_rows(case: DualStack, network: Network) -> list[Row]:
    module = network.module
    if isinstance(module, BinocularNet):
        return _binocular_rows(case, network, module)
    check_stacks(case.left, case.right, network)
    exposure = exposure_of(case.left.slices, case.right.slices)
    left, right = (encoded_stack(stack, exposure, network) for stack in (case.left, case.right))
    foci = case.left.disparities_px
    with torch.inference_mode(), _Clock(network) as clock:
        found = module(left, right, (float(foci[-1]), float(foci[0])))
        total = clock.total()
    spent = clock.seconds
    size = (case.disparity.shape[0], case.disparity.shape[1])
    seconds = {
        NETWORKS[0]: spent["focus"],
        NETWORKS[1]: spent["edof"] / 2 + spent["focus"] + spent["guided"],
        NETWORKS[2]: spent["edof"] + spent["stereo"],
        NETWORKS[3]: total,
    }
    maps = dict(zip(NETWORKS, (found.focus, found.guided, found.stereo.final, found.fused), strict=True))
    rows = [
        score_row(case, name, cropped(tensor, size)[0] * np.float32(DISPARITY_RANGE_PX), seconds[name])
        for name, tensor in maps.items()
    ]
    with torch.inference_mode():
        edof_right = module.edof(right)
    picture, other = (np.moveaxis(cropped(t, size), 0, -1) for t in (found.edof_left, edof_right))
    started = time.perf_counter()
    filled = wls_filled(decode(picture, 1.0), decode(other, 1.0), float(foci[0]))
    seconds[WLS_ON_EDOF] = spent["edof"] + time.perf_counter() - started
    rows.append(score_row(case, WLS_ON_EDOF, filled.disparity, seconds[WLS_ON_EDOF], filled.valid))
    psnr = psnr_db(picture, encode(case.sharp, exposure), case.known)
    return [*rows, Row(case.name, EDOF, None, None, None, None, None, None, None, spent["edof"] / 2, psnr)]


def _binocular_rows(case: DualStack, network: Network, module: BinocularNet) -> list[Row]:
    """Judge the binocular network with both cues, and with either taken away."""
    check_stacks(case.left, case.right, network)
    exposure = exposure_of(case.left.slices, case.right.slices)
    left, right = (encoded_stack(stack, exposure, network) for stack in (case.left, case.right))
    foci = torch.from_numpy(np.asarray(case.left.disparities_px, np.float32)).to(network.device)
    size = (case.disparity.shape[0], case.disparity.shape[1])
    rows: list[Row] = []
    for name, other, use_focus in zip(ABLATIONS, (right, right, None), (True, False, True), strict=True):
        started = time.perf_counter()
        with torch.inference_mode():
            refined, front = module(left, other, foci, use_focus)
        found = binocular_map(refined, front, size, 1.0)
        spent = time.perf_counter() - started
        rows.append(score_row(case, name, found.disparity, spent))
        if name == ABLATIONS[0]:
            rows.append(score_row(case, SURE, found.disparity, spent, found.valid))
            picture = encode(found.all_in_focus, 1.0)
            psnr = psnr_db(picture, encode(case.sharp, exposure), case.known)
            sharp = Row(case.name, "sharp image", None, None, None, None, None, None, None, spent, psnr)
    return [*rows, sharp]


class _Clock:
    """Time spent in each part of a network during one run."""

    def __init__(self, network: Network) -> None:
        self.network = network
        self.seconds = dict.fromkeys(("edof", "focus", "guided", "stereo", "fusion"), 0.0)
        self._started: dict[str, float] = {}

    def __enter__(self) -> _Clock:
        self._begin = self._now()
        self._hooks = [hook for name in self.seconds for hook in self._watch(name)]
        return self

    def __exit__(self, *_: object) -> None:
        for hook in self._hooks:
            hook.remove()

    def total(self) -> float:
        return self._now() - self._begin

    def _watch(self, name: str) -> tuple[torch.utils.hooks.RemovableHandle, torch.utils.hooks.RemovableHandle]:
        part: nn.Module = self.network.module.get_submodule(name)

        def before(*_: object) -> None:
            self._started[name] = self._now()

        def after(*_: object) -> None:
            self.seconds[name] += self._now() - self._started[name]

        return part.register_forward_pre_hook(before), part.register_forward_hook(after)

    def _now(self) -> float:
        if self.network.device == "cuda":
            torch.cuda.synchronize()
        return time.perf_counter()
