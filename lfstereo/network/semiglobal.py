"""Energies of both cues over (y, x, d), their semi-global aggregation, and what is read out of it: compiled loops.

The energy of a disparity is what it lacks to the best one of its pixel, cut off, the two cues added: a cue that is
sure of something else costs at most its ceiling, a cue that knows nothing costs nothing. What a pixel's energies have
in common plays no part in the aggregation.

References
----------
Hirschmüller, "Stereo processing by semiglobal matching and mutual information" (2008), eq. 13: eight paths.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np

from lfstereo.arrays import Float32

_FAR = np.float32(1e9)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _channels_first(row: Float32, beyond: int) -> Float32:
    """``(W, C)`` to ``(C, W + beyond)``, so that a run of disparities lies together; 0 beyond the row."""
    width, channels = row.shape
    lines = np.zeros((channels, width + beyond), np.float32)
    for x in range(width):
        for c in range(channels):
            lines[c, x] = row[x, c]
    return lines


@numba.njit(cache=True, nogil=True, fastmath=True, parallel=True)  # type: ignore[untyped-decorator]
def differences(left: Float32, right: Float32, out: Float32) -> None:
    """Fill ``(H, W, D)`` with the sum of absolute differences of each disparity's two pixels; 0 where one is unseen.

    Parameters
    ----------
    left, right
        ``(H, W, C)``; ``right`` is given mirrored in x, so that disparities follow each other.
    out
        ``(H, W, D)`` float32.
    """
    height, width, channels = left.shape
    bins = out.shape[2]
    for y in numba.prange(height):
        turned = _channels_first(right[y], bins)
        for x in range(width):
            seen = min(bins, x + 1)
            start = width - 1 - x
            sums = out[y, x]
            for d in range(bins):
                sums[d] = 0.0
            for c in range(channels):
                value, line = left[y, x, c], turned[c, start : start + bins]
                for d in range(seen):
                    sums[d] += abs(value - line[d])


@numba.njit(cache=True, nogil=True, fastmath=True, parallel=True)  # type: ignore[untyped-decorator]
def match_energy(
    left: Float32, right: Float32, differing: Float32, ceiling: float, unseen: float, out: Float32
) -> None:
    """Fill ``(H, W, D)`` with what each disparity's match lacks to the best match of the pixel.

    Parameters
    ----------
    left, right
        ``(H, W, C)`` descriptors; ``right`` is given mirrored in x, so that disparities follow each other.
    differing
        ``(H, W, D)`` of :func:`differences`, whose mean over the seen ones of 3 x 3 px counts against a match; or an
        empty array.
    ceiling, unseen
        As in :class:`lfstereo.network.penalties.Penalties`.
    out
        ``(H, W, D)`` float32.
    """
    height, width, channels = left.shape
    bins = out.shape[2]
    for y in numba.prange(height):
        turned = _channels_first(right[y], bins)
        top, bottom = max(y - 1, 0), min(y + 2, height)
        columns = np.zeros((3, bins), np.float32)
        for x in range(width):
            seen = min(bins, x + 1)
            start = width - 1 - x
            scores = out[y, x]
            for d in range(bins):
                scores[d] = 0.0
            for c in range(channels):
                weight, line = left[y, x, c], turned[c, start : start + bins]
                for d in range(bins):
                    scores[d] += weight * line[d]
            if differing.size > 0:
                for ahead in range(0 if x == 0 else 1, 2):
                    column = columns[(x + ahead) % 3]
                    for d in range(bins):
                        column[d] = 0.0
                    if x + ahead < width:
                        for row in range(top, bottom):
                            beside = differing[row, x + ahead]
                            for d in range(bins):
                                column[d] += beside[d]
                last = min(x + 1, width - 1)
                one, two, three = columns[0], columns[1], columns[2]
                for d in range(seen):
                    count = (last - max(x - 1, d) + 1) * (bottom - top)
                    scores[d] -= (one[d] + two[d] + three[d]) / count
            best = scores[0]
            for d in range(seen):
                best = max(best, scores[d])
            for d in range(seen):
                scores[d] = min(best - scores[d], ceiling)
            for d in range(seen, bins):
                scores[d] = unseen


@numba.njit(cache=True, nogil=True, fastmath=True, parallel=True)  # type: ignore[untyped-decorator]
def add_focus_energy(
    scores: Float32, foci: Float32, weight: float, slack: float, ceiling: float, energy: Float32
) -> None:
    """Add to ``(H, W, D)`` what each disparity's focus lacks to the best in focus.

    Parameters
    ----------
    scores
        ``(h, w, K)`` logits of the slices, each for a block of 4 x 4 px; interpolated between blocks.
    foci
        ``(K,)`` position of the slices on the axis of ``energy``, falling; beyond them the end slice's score holds.
    weight, slack, ceiling
        As in :class:`lfstereo.network.penalties.Penalties`.
    energy
        ``(H, W, D)`` float32, added to in place.
    """
    height, width, bins = energy.shape
    rows, columns, count = scores.shape
    lower, share = np.empty(bins, np.int64), np.empty(bins, np.float32)
    for d in range(bins):
        k = 0
        while k < count - 2 and foci[k + 1] > d:
            k += 1
        lower[d] = k
        share[d] = min(max((foci[k] - d) / (foci[k] - foci[k + 1]), 0.0), 1.0) if count > 1 else 0.0
    for y in numba.prange(height):
        line = np.empty(count, np.float32)
        fy = min(max((y - 1.5) / 4.0, 0.0), rows - 1.0)
        y0 = min(int(fy), max(rows - 2, 0))
        a = np.float32(fy - y0)
        y1 = min(y0 + 1, rows - 1)
        for x in range(width):
            fx = min(max((x - 1.5) / 4.0, 0.0), columns - 1.0)
            x0 = min(int(fx), max(columns - 2, 0))
            b = np.float32(fx - x0)
            x1 = min(x0 + 1, columns - 1)
            one = np.float32(1.0)
            w00, w01, w10, w11 = (one - a) * (one - b), (one - a) * b, a * (one - b), a * b
            best = np.float32(-1e9)
            for k in range(count):
                line[k] = w00 * scores[y0, x0, k] + w01 * scores[y0, x1, k]
                line[k] += w10 * scores[y1, x0, k] + w11 * scores[y1, x1, k]
                best = max(best, line[k])
            target = energy[y, x]
            for d in range(bins):
                k = lower[d]
                value = line[k] + share[d] * (line[min(k + 1, count - 1)] - line[k])
                target[d] += weight * min(max(best - value - slack, np.float32(0.0)), ceiling)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _begin(cost: Float32, after: Float32) -> float:
    """Begin a path: fill ``after[1:-1]``, return its lowest value. A loop compiles in a fraction of a slice's time."""
    least = np.float32(1e9)
    for d in range(cost.shape[0]):
        after[d + 1] = cost[d]
        least = min(least, cost[d])
    return float(least)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _step(cost: Float32, before: Float32, lowest: float, small: float, large: float, after: Float32) -> float:
    """One pixel further along a path: fill ``after[1:-1]``, return its lowest value."""
    bins = cost.shape[0]
    least = np.float32(1e9)
    ceiling = lowest + large
    for d in range(bins):
        best = min(before[d + 1], min(before[d], before[d + 2]) + small)
        value = cost[d] + min(best, ceiling) - lowest
        after[d + 1] = value
        least = min(least, value)
    return float(least)


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _sweep(
    energy: Float32, guide: Float32, small: float, large: float, edge: float, turned: bool, out: Float32
) -> None:
    """Sum four paths into ``out``: from the left, upper left, top and upper right; turned by 180 degrees if asked."""
    height, width, bins = energy.shape
    rows = np.full((2, 3, width + 2, bins + 2), _FAR, np.float32)
    lows = np.zeros((2, 3, width + 2), np.float32)
    beside = np.full((2, bins + 2), _FAR, np.float32)
    for i in range(height):
        y = height - 1 - i if turned else i
        back = 1 if turned else -1
        now, then = i % 2, (i + 1) % 2
        low = np.float32(0.0)
        for j in range(width):
            x = width - 1 - j if turned else j
            cost, total, level = energy[y, x], out[y, x], guide[y, x]
            if j == 0:
                low = _begin(cost, beside[0])
            else:
                step = abs(level - guide[y, x + back])
                low = _step(cost, beside[(j + 1) % 2], low, small, max(large / (1 + step / edge), small), beside[j % 2])
            here = beside[j % 2]
            for p in range(3):
                dx = p - 1
                if i == 0 or j + dx < 0 or j + dx >= width:
                    lows[now, p, j + 1] = _begin(cost, rows[now, p, j + 1])
                else:
                    step = abs(level - guide[y + back, x + (-dx if turned else dx)])
                    lows[now, p, j + 1] = _step(
                        cost,
                        rows[then, p, j + 1 + dx],
                        lows[then, p, j + 1 + dx],
                        small,
                        max(large / (1 + step / edge), small),
                        rows[now, p, j + 1],
                    )
            first, second, third = rows[now, 0, j + 1], rows[now, 1, j + 1], rows[now, 2, j + 1]
            for d in range(bins):
                total[d] = here[d + 1] + first[d + 1] + second[d + 1] + third[d + 1]


def aggregate(energy: Float32, guide: Float32, small: float, large: float, edge: float, sums: Float32) -> None:
    """Sum the energies along eight paths into ``(H, W, D)`` ``sums[0]``.

    Parameters
    ----------
    energy
        ``(H, W, D)``.
    guide
        ``(H, W)`` brightness, 0 to 1.
    small, large, edge
        As in :class:`lfstereo.network.penalties.Penalties`.
    sums
        ``(2, H, W, D)`` float32; the second half is scratch.
    """
    with ThreadPoolExecutor(min(2, numba.get_num_threads())) as pool:
        halves = [
            pool.submit(_sweep, energy, guide, small, large, edge, bool(turned), sums[turned]) for turned in (0, 1)
        ]
        for half in halves:
            half.result()
    sums[0] += sums[1]


@numba.njit(cache=True, nogil=True, fastmath=True, parallel=True)  # type: ignore[untyped-decorator]
def read_out(sums: Float32, energy: Float32, out: Float32) -> None:
    """Tell the best disparity of every pixel and how sure it is.

    Parameters
    ----------
    sums, energy
        ``(H, W, D)``.
    out
        ``(6, H, W)`` filled: the best disparity, with its fraction by a parabola; the best one elsewhere (2 or more
        away); how much more that one costs, per path; the energy of the best; by how much the right eye's own best
        differs (px; -1 where it cannot see the place); the share of the disparities that cost nearly as little.
    """
    height, width, bins = sums.shape
    for y in numba.prange(height):
        other = np.empty(width, np.float32)
        for x in range(width):
            best, at = _FAR, 0
            for d in range(min(bins, width - x)):
                if sums[y, x + d, d] < best:
                    best, at = sums[y, x + d, d], d
            other[x] = at
        for x in range(width):
            line = sums[y, x]
            at = 0
            for d in range(bins):
                if line[d] < line[at]:
                    at = d
            second, near = -1, 0
            for d in range(bins):
                near += line[d] < line[at] + 8.0
                if abs(d - at) >= 2 and (second < 0 or line[d] < line[second]):
                    second = d
            fraction = np.float32(0.0)
            if 0 < at < bins - 1:
                below, above = line[at - 1] - line[at], line[at + 1] - line[at]
                fraction = 0.5 * (below - above) / max(below + above, np.float32(1e-6))
            out[0, y, x] = at + fraction
            out[1, y, x] = second
            out[2, y, x] = (line[second] - line[at]) / 8
            out[3, y, x] = energy[y, x, at]
            match = int(x - at)
            out[4, y, x] = abs(other[match] - at) if match >= 0 else -1.0
            out[5, y, x] = near / bins
