"""How the ray tracer is compiled: cached beside the source, without checks for division by zero."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_FunctionT = TypeVar("_FunctionT", bound=Callable[..., Any])


def compiled(function: _FunctionT) -> _FunctionT:
    """Compile a function for one thread."""
    return cast(_FunctionT, numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")(function))


def compiled_parallel(function: _FunctionT) -> _FunctionT:
    """Compile a function whose ``numba.prange`` loops run on all cores."""
    return cast(
        _FunctionT, numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy", parallel=True)(function)
    )
