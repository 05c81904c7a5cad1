"""Compare every network of a model, and what a user without a network would run, on scenes of known disparity."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from lfstereo.arrays import Bool, Float32, Rgb
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.depth.baselines import fill_from_background, sgbm, sgbm_wls
from lfstereo.depth.disparity import DisparityMap
from lfstereo.depth.metrics import score_disparity
from lfstereo.focus.measures import depth_from_focus
from lfstereo.network.encoding import decode, encode, exposure_of
from lfstereo.network.estimate import Network, check_stacks, network_input
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stack_dataset import DualStack, read_dual_stack
from lfstereo.simulate.stereo_scenes import SceneFiles, read_scene
from lfstereo.simulate.synthesis import photograph
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions
from lfstereo.training.generated_dataset import dual_stack_of
from lfstereo.training.samples import stack_sample
from lfstereo.training.textures import texture_bank

NETWORKS = ("Focus-Net", "Focus-Net-Guided", "Stereo-Net", "BDfF-Net")
BASELINES = ("SGBM", "SGBM+WLS filled", "depth from focus")
EDOF = "EDoF-Net"
WLS_ON_EDOF = "SGBM+WLS on EDoF"
"""Classical stereo on the two images of EDoF-Net: it sees no more than the networks do."""
ALL = "all"


@dataclass(frozen=True, slots=True)
class Row:
    """What one method got on one scene, or on all; ``None`` where it does not apply."""

    scene: str
    method: str
    mae_norm: float | None
    """Mean absolute error in units of 100 px."""
    mae_px: float | None
    bad_05: float | None
    """Percent of the answered pixels that are off by more than 0.5 px."""
    bad_1: float | None
    bad_2: float | None
    bad_4: float | None
    density: float | None
    """Percent of the pixels of known truth that are answered."""
    seconds: float
    psnr_db: float | None = None
    """Of the all-in-focus image against the sharp one, display-referred."""


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
    rows.append(_row(case, BASELINES[0], plain.disparity, time.perf_counter() - started, plain.valid))
    started = time.perf_counter()
    filled = _wls_filled(case.sharp, case.sharp_right, near)
    rows.append(_row(case, BASELINES[1], filled.disparity, time.perf_counter() - started, filled.valid))
    started = time.perf_counter()
    focused = depth_from_focus(case.left)
    rows.append(_row(case, BASELINES[2], focused.disparity, time.perf_counter() - started))
    return rows


def summarise(rows: Sequence[Row]) -> list[Row]:
    """Average every column over the scenes, each scene weighing the same; one row per method.

    Examples
    --------
    >>> def one(mae): return Row("a", "SGBM", mae / 100, mae, 1.0, 1.0, 1.0, 1.0, 90.0, 0.5)
    >>> summarise([one(2.0), one(4.0)])[0].mae_px
    3.0
    """
    numbers = [f.name for f in fields(Row) if f.name not in ("scene", "method")]
    found = []
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        columns = {name: [getattr(row, name) for row in own] for name in numbers}
        means = {n: None if None in values else math.fsum(values) / len(values) for n, values in columns.items()}
        found.append(Row(ALL, method, **means))  # type: ignore[arg-type]
    return found


def _network_rows(case: DualStack, network: Network) -> list[Row]:
    architecture = network.module.architecture
    check_stacks(case.left, case.right, architecture.slices)
    exposure = exposure_of(case.left.slices, case.right.slices)
    left, right = (
        network_input(encode(stack.slices, exposure), architecture.multiple).to(network.device)
        for stack in (case.left, case.right)
    )
    foci = case.left.disparities_px
    with torch.inference_mode(), _Clock(network) as clock:
        found = network.module(left, right, (float(foci[-1]), float(foci[0])))
        total = clock.total()
    spent = clock.seconds
    height, width = case.disparity.shape
    seconds = {
        NETWORKS[0]: spent["focus"],
        NETWORKS[1]: spent["edof"] / 2 + spent["focus"] + spent["guided"],
        NETWORKS[2]: spent["edof"] + spent["stereo"],
        NETWORKS[3]: total,
    }
    maps = dict(zip(NETWORKS, (found.focus, found.guided, found.stereo.final, found.fused), strict=True))
    rows = [
        _row(case, name, _cropped(tensor, height, width)[0] * np.float32(DISPARITY_RANGE_PX), seconds[name])
        for name, tensor in maps.items()
    ]
    with torch.inference_mode():
        edof_right = network.module.edof(right)
    picture, other = (np.moveaxis(_cropped(t, height, width), 0, -1) for t in (found.edof_left, edof_right))
    started = time.perf_counter()
    filled = _wls_filled(decode(picture, 1.0), decode(other, 1.0), float(foci[0]))
    seconds[WLS_ON_EDOF] = spent["edof"] + time.perf_counter() - started
    rows.append(_row(case, WLS_ON_EDOF, filled.disparity, seconds[WLS_ON_EDOF], filled.valid))
    psnr = psnr_db(picture, encode(case.sharp, exposure), case.known)
    return [*rows, Row(case.name, EDOF, None, None, None, None, None, None, None, spent["edof"] / 2, psnr)]


def psnr_db(picture: Float32, truth: Float32, counted: Bool) -> float:
    """Return the peak signal-to-noise ratio of a picture in 0 to 1, over the counted pixels.

    Examples
    --------
    >>> round(psnr_db(np.full((2, 2, 3), 0.6), np.full((2, 2, 3), 0.5), np.ones((2, 2), bool)), 6)
    20.0
    """
    error = float(np.mean((np.clip(picture, 0, 1).astype(np.float64) - truth)[counted] ** 2))
    return -10 * math.log10(max(error, 1e-12))


def _wls_filled(left: Rgb, right: Rgb, d_max: float) -> DisparityMap:
    """Match and fill; a pair without a single match stays without answers."""
    found = sgbm_wls(left, right, d_max)
    return fill_from_background(found) if found.valid.any() else found


def _row(case: DualStack, method: str, disparity: Float32, seconds: float, answered: Bool | None = None) -> Row:
    if answered is not None and not (answered & case.known).any():
        return Row(case.name, method, None, None, None, None, None, None, 0.0, seconds)
    scores = score_disparity(np.maximum(disparity, 0), case.disparity, case.known, answered)
    return Row(
        scene=case.name,
        method=method,
        mae_norm=scores.mae_px / DISPARITY_RANGE_PX,
        mae_px=scores.mae_px,
        bad_05=scores.bad_05,
        bad_1=scores.bad_1,
        bad_2=scores.bad_2,
        bad_4=scores.bad_4,
        density=scores.density,
        seconds=seconds,
    )


def _cropped(tensor: Tensor, height: int, width: int) -> Float32:
    return np.asarray(tensor[0, :, :height, :width].float().cpu().numpy(), np.float32)


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
