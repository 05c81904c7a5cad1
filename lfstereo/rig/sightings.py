"""Where the corners of a target were seen: the measurements that a calibration is computed from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Bool, Float64
from lfstereo.errors import ShapeError

_SAME_VIEW = 0.1
"""Positions that differ by less than this share of the pupil's radius belong to one view, or one block of views."""


@dataclass(frozen=True, slots=True)
class Sightings:
    """Corners of one target that one camera saw in one shot, in all views together."""

    source: str
    """Capture it comes from, for messages."""
    serial: str
    """Camera serial number, empty where unknown."""
    corner: np.ndarray[tuple[int], np.dtype[np.intp]]
    """``(M,)`` row of ``Target.points``."""
    offset: Float64
    """``(M, 2)`` position of the view inside the micro-images, sensor px from the centre; 0 for a pinhole camera."""
    place: Float64
    """``(M, 2)`` (x, y) of the corner on the lattice of micro-image centres, sensor px."""
    weight: Float64
    """``(M,)`` confidence, 1 = full; 0 = not to be used."""

    def __post_init__(self) -> None:
        count = len(self.corner)
        for name, shape in (("offset", (count, 2)), ("place", (count, 2)), ("weight", (count,))):
            if getattr(self, name).shape != shape:
                raise ShapeError(f"{self.source}: {name} has shape {getattr(self, name).shape}, expected {shape}")

    def centre_view(self) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], Float64]:
        """Return the corners seen in the view nearest to the centre and their places ``(N, 2)``."""
        used = np.flatnonzero(self.weight > 0)
        away = np.abs(self.offset[used]).max(axis=1)
        order = used[np.argsort(away, kind="stable")]
        _, first = np.unique(self.corner[order], return_index=True)
        nearest = order[first]
        near = np.abs(self.offset[nearest]).max(axis=1)
        nearest = nearest[near <= near.min() + _SAME_VIEW * away.max()]
        return self.corner[nearest], self.place[nearest]


def reach_px(shots: Sequence[Sightings]) -> tuple[Float64, Float64]:
    """Return the smallest and largest place seen in any shot, ``(2,)`` each."""
    low = np.min([shot.place[shot.weight > 0].min(axis=0) for shot in shots], axis=0)
    high = np.max([shot.place[shot.weight > 0].max(axis=0) for shot in shots], axis=0)
    return low, high


def usable(shot: Sightings, least: int = 8) -> bool:
    """Return whether a shot shows enough corners, not all in one line, for a pose."""
    if not np.any(shot.weight > 0):
        return False
    _, place = shot.centre_view()
    spread: Bool = np.linalg.svd(place - place.mean(axis=0), compute_uv=False) > 1e-3 * (1 + np.ptp(place))
    return len(place) >= least and bool(spread.all())


def merge_views(shot: Sightings, blocks: int) -> Sightings:
    """Average each corner's places over blocks of neighbouring views.

    Within a block the place is a straight function of the view's position, so that the weighted means of both
    still belong together; a rig is found from the means as well as from all views, in a fraction of the time.

    Parameters
    ----------
    blocks
        Number of blocks along both directions of the pupil; odd, so that one is central.
    """
    reach = max(float(np.abs(shot.offset).max(initial=0.0)), 1e-9) * (1 + 1e-9)
    column, row = np.floor((shot.offset / reach + 1) / 2 * blocks).astype(np.intp).T
    key, group = np.unique((shot.corner * blocks + row) * blocks + column, return_inverse=True)
    total: Float64 = np.bincount(group, shot.weight).astype(np.float64)
    seen = total > 0

    def mean(values: Float64) -> Float64:
        sums = np.stack([np.bincount(group, shot.weight * v) for v in values.T], axis=1)
        means: Float64 = sums[seen] / total[seen, None]
        return means

    return Sightings(
        shot.source, shot.serial, (key // blocks**2)[seen], mean(shot.offset), mean(shot.place), total[seen]
    )
