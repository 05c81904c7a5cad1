"""Energies, aggregation and read-out against plain Python."""

import numpy as np
import pytest
import torch

from lfstereo.network import semiglobal_torch
from lfstereo.network.binocular_net import READINGS
from lfstereo.network.penalties import Penalties
from lfstereo.network.semiglobal import add_focus_energy, aggregate, differences, match_energy, read_out

ULPS = 1e-5
"""Tolerance of sums of some ten float32."""


def unit(rng: np.random.Generator, *shape: int) -> np.ndarray:
    vectors = rng.standard_normal(shape, dtype=np.float32)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_match_energy_is_what_a_match_lacks_to_the_best() -> None:
    rng = np.random.default_rng(0)
    left, right = 5 * unit(rng, 2, 9, 5), unit(rng, 2, 9, 5)
    energy = np.empty((2, 9, 4), np.float32)
    match_energy(left, np.ascontiguousarray(right[:, ::-1]), np.empty((0, 9, 4), np.float32), 3.0, 1.5, energy)
    for y, x in np.ndindex(2, 9):
        scores = [float(left[y, x] @ right[y, x - d]) for d in range(min(4, x + 1))]
        wanted = [min(max(scores) - s, 3.0) for s in scores] + [1.5] * (4 - len(scores))
        assert energy[y, x] == pytest.approx(wanted, abs=ULPS)


def test_differences_of_looks_count_against_a_match_as_their_mean_over_3_x_3_px() -> None:
    rng = np.random.default_rng(3)
    looks, other = rng.random((4, 9, 3), dtype=np.float32), rng.random((4, 9, 3), dtype=np.float32)
    differing, energy = np.empty((4, 9, 5), np.float32), np.empty((4, 9, 5), np.float32)
    differences(looks, np.ascontiguousarray(other[:, ::-1]), differing)
    none = np.zeros((4, 9, 1), np.float32)
    match_energy(none, none, differing, 3.0, 1.5, energy)
    for y, x in np.ndindex(4, 9):
        costs = []
        for d in range(min(5, x + 1)):
            beside = [(v, u) for v in (y - 1, y, y + 1) for u in (x - 1, x, x + 1) if 0 <= v < 4 and d <= u < 9]
            costs.append(float(np.mean([np.abs(looks[v, u] - other[v, u - d]).sum() for v, u in beside])))
        wanted = [min(cost - min(costs), 3.0) for cost in costs] + [1.5] * (5 - len(costs))
        assert energy[y, x] == pytest.approx(wanted, abs=ULPS)


def test_focus_energy_stands_at_each_slice_s_own_disparity() -> None:
    scores = np.zeros((1, 1, 3), np.float32) + np.float32([0.0, 2.0, 1.0])
    energy = np.ones((4, 4, 9), np.float32)
    add_focus_energy(scores, np.float32([8.0, 4.0, 2.0]), 2.0, 0.0, 1.5, energy)
    wanted = 1 + 2 * np.float32([1.0, 1.0, 1.0, 0.5, 0.0, 0.5, 1.0, 1.5, 1.5])  # ceiling 1.5 from 7 px on
    assert np.allclose(energy, wanted, atol=ULPS)
    add_focus_energy(scores, np.float32([8.0, 4.0, 2.0]), 2.0, 0.75, 1.5, energy)
    wanted += 2 * np.float32([0.25, 0.25, 0.25, 0.0, 0.0, 0.0, 0.25, 0.75, 1.25])  # 0.75 is lacked for nothing
    assert np.allclose(energy, wanted, atol=ULPS)


def test_focus_scores_are_interpolated_between_blocks() -> None:
    scores = np.float32([[[0.0, 0.0], [0.0, 4.0]]])
    energy = np.zeros((4, 8, 2), np.float32)
    add_focus_energy(scores, np.float32([1.0, 0.0]), 1.0, 0.0, 9.0, energy)
    lacking = energy[0, :, 1]  # of the nearer slice to the farther one, whose score rises from 0 to 4
    assert lacking == pytest.approx(np.clip((np.arange(8) - 1.5) / 4, 0, 1) * 4, abs=ULPS)


def plain_aggregation(energy: np.ndarray, guide: np.ndarray, small: float, large: float, edge: float) -> np.ndarray:
    height, width, bins = energy.shape
    total = np.zeros(energy.shape)
    for dy, dx in ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)):
        path = np.zeros(energy.shape)
        for y in range(height)[:: -1 if dy < 0 else 1]:
            for x in range(width)[:: -1 if dx < 0 else 1]:
                py, px = y - dy, x - dx
                path[y, x] = energy[y, x]
                if 0 <= py < height and 0 <= px < width:
                    before = path[py, px]
                    jump = max(large / (1 + abs(guide[y, x] - guide[py, px]) / edge), small)
                    for d in range(bins):
                        near = [before[e] + small for e in (d - 1, d + 1) if 0 <= e < bins]
                        path[y, x, d] += min(before[d], *near, before.min() + jump) - before.min()
        total += path
    return total


def test_aggregation_sums_eight_paths() -> None:
    rng = np.random.default_rng(1)
    energy = rng.uniform(0, 5, (5, 6, 4)).astype(np.float32)
    guide = rng.random((5, 6), dtype=np.float32)
    sums = np.empty((2, 5, 6, 4), np.float32)
    aggregate(energy, guide, 0.7, 3.0, 0.1, sums)
    assert np.allclose(sums[0], plain_aggregation(energy, guide, 0.7, 3.0, 0.1), atol=1e-4)


def test_read_out_of_a_known_volume() -> None:
    sums = np.full((1, 6, 5), 40.0, np.float32)
    energy = np.full((1, 6, 5), 3.0, np.float32)
    sums[0, :, 1], sums[0, :, 0], sums[0, :, 2] = 0.0, 10.0, 20.0
    sums[0, :, 4] = 16.0
    energy[0, :, 1] = 0.25
    out = np.empty((READINGS, 1, 6), np.float32)
    read_out(sums, energy, out)
    best, second, margin, cost, left_right, near = out[:, 0]
    assert best == pytest.approx(np.full(6, 1 + 0.5 * (10 - 20) / 30), abs=ULPS)
    assert second.tolist() == [4.0] * 6 and margin.tolist() == [2.0] * 6 and cost.tolist() == [0.25] * 6
    assert left_right.tolist() == [-1.0] + [0.0] * 5  # the right eye cannot see what would lie at x = -1
    assert near == pytest.approx(np.full(6, 1 / 5), abs=ULPS)


def test_torch_tells_the_same_as_the_compiled_loops() -> None:
    rng = np.random.default_rng(2)
    weights = Penalties(match_ceiling=4.0, unseen=1.0, focus_ceiling=2.0, focus_slack=0.5, small=0.5, large=3.0)
    left, right = 5 * unit(rng, 12, 20, 5), unit(rng, 12, 20, 5)
    scores = rng.standard_normal((3, 5, 4), dtype=np.float32)
    foci, guide = np.float32([11.0, 7.0, 2.5, 1.0]), rng.random((12, 20), dtype=np.float32)
    looks, other = rng.random((12, 20, 9), dtype=np.float32), rng.random((12, 20, 9), dtype=np.float32)
    energy, differing = np.empty((12, 20, 14), np.float32), np.empty((12, 20, 14), np.float32)
    differences(looks, np.ascontiguousarray(other[:, ::-1]), differing)
    match_energy(left, np.ascontiguousarray(right[:, ::-1]), differing, 4.0, 1.0, energy)
    add_focus_energy(scores, foci, 1.0, 0.5, 2.0, energy)
    sums, readings = np.empty((2, *energy.shape), np.float32), np.empty((READINGS, 12, 20), np.float32)
    aggregate(energy, guide, 0.5, 3.0, weights.edge, sums)
    read_out(sums[0], energy, readings)
    first, second, look, same_look = (torch.from_numpy(a).permute(2, 0, 1) for a in (left, right, looks, other))
    matched = semiglobal_torch.Matched((first, second), (look, same_look))
    same = semiglobal_torch.volume_energy(
        matched, torch.from_numpy(scores).permute(2, 0, 1), torch.from_numpy(foci), 14, weights
    )
    assert np.allclose(same.numpy(), energy, atol=ULPS)
    total = semiglobal_torch.aggregate(same, torch.from_numpy(guide), weights)
    assert np.allclose(total.numpy(), sums[0], atol=1e-4)
    told = semiglobal_torch.read_out(torch.from_numpy(sums[0]), torch.from_numpy(energy))
    assert np.allclose(told.numpy(), readings, atol=1e-4)
