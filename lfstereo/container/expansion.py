"""How much memory a compressed file may ask for."""

from __future__ import annotations

from lfstereo.errors import ContainerError

ALWAYS_ALLOWED_BYTES = 256 << 20
LARGEST_RATIO = 100
"""Photographs shrink to a tenth at most, flat pictures to a hundredth; deflate reaches 1000 on zeros alone."""


def check_expansion(stored: int, expanded: int, where: str) -> None:
    """Refuse what would fill the memory with next to nothing: more than 256 MiB and a hundred times its file.

    Parameters
    ----------
    stored
        Bytes on disk.
    expanded
        Bytes that its head says it has once it is decompressed.
    where
        File name for messages.

    Raises
    ------
    ContainerError
        If it would take more.
    """
    allowed = max(ALWAYS_ALLOWED_BYTES, LARGEST_RATIO * stored)
    if expanded > allowed:
        raise ContainerError(
            f"{where}: says that its {stored} bytes hold {expanded}, expected at most {allowed}; the file is damaged "
            "or made to fill the memory, do not use it"
        )
