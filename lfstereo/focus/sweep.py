"""A focus sweep: pictures of one scene by one camera, each focused at another distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float32, Float64, check_shape
from lfstereo.errors import ConfigError, ShapeError


@dataclass(frozen=True, slots=True)
class LensData:
    """What the pictures' metadata tell of the lens; ``None`` where they do not."""

    focal_px: float | None = None
    """Focal length in px of the slices as they are kept."""
    aperture_m: float | None = None
    """Diameter of the entrance pupil, m."""


@dataclass(frozen=True, slots=True)
class FocusSweep:
    """Pictures of one scene, near to far where the distances are known, else in the order of their names."""

    slices: Float32
    """``(K, V, U, 3)`` float32 linear RGB."""
    names: tuple[str, ...]
    """``(K,)`` file names."""
    distances_m: Float64 | None
    """``(K,)`` distance in focus, m, rising, the last may be infinite; ``None``: not known."""
    full_size: tuple[int, int]
    """(rows, columns) of the pictures before they were reduced."""
    lens: LensData
    source: str

    def __post_init__(self) -> None:
        check_shape(f"{self.source}: slices", self.slices, (None, None, None, 3))
        if len(self.names) != len(self.slices):
            raise ShapeError(f"{self.source}: {len(self.names)} names, expected {len(self.slices)}, one per slice")
        if self.distances_m is not None:
            check_shape(f"{self.source}: focus distances", self.distances_m, (len(self.slices),))
            if not (self.distances_m[0] > 0 and np.all(np.diff(self.distances_m) > 0)):
                raise ShapeError(f"{self.source}: focus distances must be above 0 m and rise from slice to slice")

    @property
    def reduction(self) -> float:
        """Px of the original pictures per px of the slices."""
        return self.full_size[1] / int(self.slices.shape[2])


def vergence(sweep: FocusSweep) -> Float64:
    """Return ``(K,)`` 1/m in focus, the scale on which blur and disparity are linear.

    Raises
    ------
    ConfigError
        If the focus distances are not known.
    """
    if sweep.distances_m is None:
        raise ConfigError(
            f"{sweep.source}: the pictures do not tell their focus distances, expected EXIF SubjectDistance in each, "
            "all different; give a table with --distances FILE.csv"
        )
    return 1.0 / sweep.distances_m


def depth_at(index: Float32, sweep: FocusSweep) -> Float32:
    """Return the distance in m in focus at fractional slices, linear in 1/m between them; infinity is 0.

    Parameters
    ----------
    index
        ``(V, U)`` slices.

    Raises
    ------
    ConfigError
        If the focus distances are not known.

    Examples
    --------
    Half way between 1 m and infinity lies 2 m.

    >>> slices = np.zeros((2, 1, 1, 3), np.float32)
    >>> sweep = FocusSweep(slices, ("a", "b"), np.array([1.0, np.inf]), (1, 1), LensData(), "example")
    >>> depth_at(np.float32([[0.5, 1.0]]), sweep).tolist()
    [[2.0, 0.0]]
    """
    per_m = np.interp(index, np.arange(len(sweep.slices)), vergence(sweep))
    return np.divide(1.0, per_m, out=np.zeros_like(per_m), where=per_m > 0).astype(np.float32)
