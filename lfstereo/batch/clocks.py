"""Two cameras' clocks: how far apart they are, and which exposures are one moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lfstereo.arrays import Float64

_RIVAL_SHARE = 0.6
"""A second offset that explains more than this share of the best one's pairs makes the estimate ambiguous."""
_LEAST_PAIRS = 2
"""Pairs that must agree on an offset, unless the clocks themselves agree."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How much the right camera's clock is ahead of the left one's."""

    offset_s: float
    """To be added to a left time; median over the pairs."""
    spread_s: float
    """Largest distance of a pair from it."""
    agreeing: int
    """Pairs that it explains."""
    given: bool
    """True: by the user; false: estimated."""


@dataclass(frozen=True, slots=True)
class TimeMatches:
    """Indices of left and right captures by time."""

    clock: ClockOffset | None
    """``None`` where no offset is certain."""
    pairs: tuple[tuple[int, int], ...] = ()
    ambiguous: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = ()
    """Groups of left and right captures within the tolerance, more than one of a side."""
    lonely_left: tuple[int, ...] = ()
    lonely_right: tuple[int, ...] = ()
    reason: str = ""
    """Why the lonely ones are alone."""


def pair_by_time(
    left_s: Sequence[float], right_s: Sequence[float], tolerance_s: float, offset_s: float | None = None
) -> TimeMatches:
    """Pair exposures by time, after taking off the difference of the clocks.

    The offset is the one that explains most pairs: the place where the differences of all left to all right times
    lie densest. It is refused where another one explains nearly as many, as with pictures taken at equal intervals.

    Parameters
    ----------
    left_s, right_s
        Capture times, s, each by its own camera's clock.
    tolerance_s
        Largest difference within a pair.
    offset_s
        Right clock minus left clock where it is known.

    Examples
    --------
    >>> found = pair_by_time([0.0, 7.0, 30.0], [100.1, 107.0, 130.0], 1.0)
    >>> found.pairs, round(found.clock.offset_s, 3)
    (((0, 0), (1, 1), (2, 2)), 100.0)
    """
    left, right = np.asarray(left_s, np.float64), np.asarray(right_s, np.float64)
    everyone = TimeMatches(None, lonely_left=tuple(range(len(left))), lonely_right=tuple(range(len(right))))
    if not len(left) or not len(right):
        return replace(everyone, reason="there is no capture of the other camera")
    given = offset_s is not None
    if offset_s is None:
        offset_s, doubt = _estimate(left, right, tolerance_s)
        if doubt:
            return replace(everyone, reason=f"{doubt}; give --clock-offset-s")
    pairs, ambiguous = _match(left, right, tolerance_s, offset_s)
    off = np.array([right[j] - left[i] for i, j in pairs])
    middle = float(np.median(off)) if len(off) and not given else offset_s
    spread = float(np.abs(off - middle).max()) if len(off) else 0.0
    taken = {i for i, _ in pairs} | {i for group, _ in ambiguous for i in group}
    used = {j for _, j in pairs} | {j for _, group in ambiguous for j in group}
    return TimeMatches(
        clock=ClockOffset(middle, spread, len(pairs), given),
        pairs=pairs,
        ambiguous=ambiguous,
        lonely_left=tuple(i for i in range(len(left)) if i not in taken),
        lonely_right=tuple(j for j in range(len(right)) if j not in used),
        reason=f"no capture of the other camera within {tolerance_s:g} s, clocks {middle:+.1f} s apart",
    )


def _estimate(left: Float64, right: Float64, tolerance_s: float) -> tuple[float, str]:
    """Return the offset and, where it is not certain, why not."""
    differences = np.sort((right[None, :] - left[:, None]).ravel())
    best, offset = _densest(differences, tolerance_s)
    away = differences[np.abs(differences - offset) > 2 * tolerance_s]
    rival, other = _densest(away, tolerance_s)
    if rival > _RIVAL_SHARE * best:
        return offset, (
            f"capture times fit clocks {offset:+.1f} s apart ({best} pairs) and {other:+.1f} s apart ({rival} pairs)"
        )
    if best < _LEAST_PAIRS and abs(offset) > tolerance_s:
        return offset, f"one pair alone does not tell whether the clocks are {offset:+.1f} s apart"
    return offset, ""


def _densest(differences: Float64, tolerance_s: float) -> tuple[int, float]:
    """Return how many sorted differences lie within a window of the tolerance, at most, and their median."""
    if not len(differences):
        return 0, 0.0
    ends = np.searchsorted(differences, differences + tolerance_s, side="right")
    counts = ends - np.arange(len(differences))
    first = int(np.argmax(counts))
    return int(counts[first]), float(np.median(differences[first : ends[first]]))


def _match(
    left: Float64, right: Float64, tolerance_s: float, offset_s: float
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]]:
    """Return pairs and groups: exposures are linked when within the tolerance, and a group is all that is linked."""
    moments = [(t + offset_s, 0, i) for i, t in enumerate(left)] + [(t, 1, j) for j, t in enumerate(right)]
    groups: list[list[tuple[float, int, int]]] = []
    for moment in sorted(moments):
        near = groups and moment[0] - groups[-1][-1][0] <= tolerance_s
        if near:
            groups[-1].append(moment)
        else:
            groups.append([moment])
    pairs, ambiguous = [], []
    for group in groups:
        lefts = tuple(i for _, side, i in group if side == 0)
        rights = tuple(j for _, side, j in group if side == 1)
        if len(lefts) == len(rights) == 1:
            pairs.append((lefts[0], rights[0]))
        elif lefts and rights:
            ambiguous.append((lefts, rights))
    return tuple(pairs), tuple(ambiguous)
