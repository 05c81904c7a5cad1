"""Names for the arrays that pass between stages, and the check of their shapes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from lfstereo.errors import ShapeError

Float32: TypeAlias = npt.NDArray[np.float32]
Float64: TypeAlias = npt.NDArray[np.float64]
UInt8: TypeAlias = npt.NDArray[np.uint8]
UInt16: TypeAlias = npt.NDArray[np.uint16]
Bool: TypeAlias = npt.NDArray[np.bool_]

Mosaic: TypeAlias = npt.NDArray[np.uint16]
"""``(H, W)`` Bayer mosaic in digital numbers, as the sensor read it out."""

Rgb: TypeAlias = npt.NDArray[np.float32]
"""``(H, W, 3)`` linear RGB, 1.0 = white."""

Views: TypeAlias = npt.NDArray[np.float32]
"""``(T, S, V, U, 3)`` linear RGB views of a light field."""

Disparity: TypeAlias = npt.NDArray[np.float32]
"""``(V, U)`` disparity in px of the rectified left centre view."""


def check_shape(name: str, array: npt.NDArray[np.generic], expected: tuple[int | None, ...]) -> None:
    """Refuse an array whose shape differs from the expected one.

    Parameters
    ----------
    name
        What the array is, for the message.
    array
        The array to look at.
    expected
        One entry per axis; ``None`` accepts any length.

    Raises
    ------
    ShapeError
        If the number of axes or a length differs.

    Examples
    --------
    >>> import numpy as np
    >>> check_shape("image", np.zeros((4, 5, 3)), (None, None, 3))
    """
    fits = array.ndim == len(expected) and all(
        want is None or want == have for want, have in zip(expected, array.shape, strict=True)
    )
    if not fits:
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in expected) + ")"
        raise ShapeError(f"{name}: found an array of shape {array.shape}, expected {wanted}")
