"""The picture at a pupil point between four views of a light field."""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Float32, UInt8
from lfstereo.lightfield.field import LightField

_SAME_VIEW = 1e-6
"""Pupil points this close, in views, are one."""


def view_between(light_field: LightField, t: float, s: float) -> tuple[Float32, UInt8]:
    """Return the picture ``(V, U, 3)`` at view row t and column s, whole or not, and its weight ``(V, U)``.

    Linear along both directions of the pupil, as the neighbours' confidence allows: a sample that one of them lacks
    comes from the others. Neighbouring views differ by less than a px where this is used.

    Parameters
    ----------
    t, s
        Within the light field; whole numbers give the view itself.
    """
    rows, columns = light_field.views.shape[:2]
    t, s = min(max(t, 0.0), rows - 1.0), min(max(s, 0.0), columns - 1.0)
    near = round(t), round(s)
    if max(abs(t - near[0]), abs(s - near[1])) < _SAME_VIEW:
        view: Float32 = light_field.views[near]
        full = np.full(view.shape[:2], 255, np.uint8)
        return view, full if light_field.weight is None else light_field.weight[near]
    first = min(int(t), max(rows - 2, 0)), min(int(s), max(columns - 2, 0))
    block = slice(first[0], first[0] + 2), slice(first[1], first[1] + 2)
    views = light_field.views[block]
    full = np.broadcast_to(np.uint8(255), views.shape[:4])
    weight = full if light_field.weight is None else light_field.weight[block]
    picture, sure = np.empty_like(views[0, 0]), np.empty(views.shape[2:4], np.uint8)
    _blend(views, weight, t - first[0], s - first[1], picture, sure)
    return picture, sure


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _blend(
    views: Float32, weight: UInt8, below: float, right: float, picture: Float32, sure: UInt8
) -> None:  # pragma: no cover
    """Fill the blend of a block ``(T, S, V, U, 3)`` of one or two views along both directions."""
    rows, columns, v_count, u_count, channels = views.shape
    for v in range(v_count):
        for u in range(u_count):
            total = 0.0
            for c in range(channels):
                picture[v, u, c] = 0.0
            for t in range(rows):
                for s in range(columns):
                    share = (below if t else 1 - below) * (right if s else 1 - right) * weight[t, s, v, u]
                    if share > 0:
                        total += share
                        for c in range(channels):
                            picture[v, u, c] += np.float32(share) * views[t, s, v, u, c]
            if total > 0:
                for c in range(channels):
                    picture[v, u, c] /= np.float32(total)
            sure[v, u] = np.uint8(total + 0.5)
