"""The inner loops of unpacking, compiled."""

from __future__ import annotations

import numba

from lfstereo.arrays import UInt8, UInt16


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def unpack_10(groups: UInt8, pixels: UInt16) -> None:  # pragma: no cover
    """Fill ``(N, 4)`` pixels of 10 bits from ``(N, 5)`` bytes: four high bytes, then the low two bits of each."""
    for n in range(groups.shape[0]):
        low = groups[n, 4]
        pixels[n, 0] = groups[n, 0] << 2 | (low & 3)
        pixels[n, 1] = groups[n, 1] << 2 | (low >> 2 & 3)
        pixels[n, 2] = groups[n, 2] << 2 | (low >> 4 & 3)
        pixels[n, 3] = groups[n, 3] << 2 | (low >> 6)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def unpack_12(groups: UInt8, pixels: UInt16) -> None:  # pragma: no cover
    """Fill ``(N, 2)`` pixels of 12 bits from ``(N, 3)`` bytes, the highest bits first."""
    for n in range(groups.shape[0]):
        pixels[n, 0] = groups[n, 0] << 4 | groups[n, 1] >> 4
        pixels[n, 1] = (groups[n, 1] & 15) << 8 | groups[n, 2]
