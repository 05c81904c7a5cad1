"""HDF5 data sets, taken only as far as they lie in their own file and fit its size."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py

from lfstereo.container.expansion import check_expansion
from lfstereo.errors import ContainerError

_LARGEST_CHUNK_BYTES = 256 << 20


def stored_dataset(file: Any, name: str, path: Path) -> Any:
    """Return a data set of an open file, or None where there is none of that name.

    Raises
    ------
    ContainerError
        If it lies in another file, is not whole, or says it is far larger than what is stored.
    """
    link = file.get(name, getlink=True)
    if link is None:
        return None
    if isinstance(link, h5py.ExternalLink):
        raise ContainerError(f"{path}: '{name}' does not lie in this file, expected that it does; do not use it")
    found = file.get(name)
    if not isinstance(found, h5py.Dataset) or found.shape is None or found.dtype.hasobject:
        raise ContainerError(f"{path}: '{name}' is no array of numbers, expected one; decode the capture again")
    size, stored = math.prod(found.shape) * found.dtype.itemsize, found.id.get_storage_size()
    if found.external or found.is_virtual or stored > path.stat().st_size:
        raise ContainerError(
            f"{path}: '{name}' of shape {found.shape} does not lie in this file, expected that it does; do not use it"
        )
    if found.id.get_create_plist().get_nfilters() == 0 and stored < size:
        raise ContainerError(
            f"{path}: '{name}' does not lie whole in this file, it holds {stored} of {size} bytes; the file was cut "
            "off, decode the capture again"
        )
    check_expansion(stored, size, f"{path}: '{name}'")
    if found.chunks and math.prod(found.chunks) * found.dtype.itemsize > max(_LARGEST_CHUNK_BYTES, size):
        raise ContainerError(f"{path}: '{name}' has chunks of {found.chunks}, expected smaller ones; do not use it")
    return found
