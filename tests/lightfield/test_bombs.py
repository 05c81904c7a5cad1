"""Files of a few bytes that say they hold gigabytes are refused, with little memory, on one line."""

from __future__ import annotations

import resource
import struct
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from lfstereo.container import expansion
from lfstereo.errors import ContainerError
from lfstereo.lightfield import LightField, read_light_field, write_light_field
from lfstereo.lightfield.interchange import mat5
from lfstereo.lightfield.interchange.lftoolbox_mat import write_decoded_mat

HEADROOM_BYTES = 1 << 30
"""Address space beyond what the process has; each bomb would take more."""
SMALL = np.zeros((2, 2, 3, 4, 3), np.uint16)
HUGE = (15, 15, 4000, 6000, 3)
"""32 GB of 16-bit numbers."""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of address space are Linux's")


@pytest.fixture(autouse=True)
def little_memory() -> Iterator[None]:
    """Let the process grow by a GiB only, so that an allocation from a head fails the test."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + HEADROOM_BYTES, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.fixture
def stored(tmp_path: Path, little_memory: None) -> Path:
    path = tmp_path / "a.h5"
    write_light_field(path, LightField(SMALL.astype(np.float32), None, None, "", "a"))
    return path


def refused(path: Path, message: str) -> None:
    with pytest.raises(ContainerError, match=message) as caught:
        read_light_field(path)
    assert "\n" not in str(caught.value)


def replace_views(path: Path, **layout: Any) -> None:
    with h5py.File(path, "r+") as file:
        attributes = dict(file["views"].attrs)
        del file["views"]
        file.create_dataset("views", **layout).attrs.update(attributes)


def test_views_that_were_never_written(stored: Path) -> None:
    replace_views(stored, shape=HUGE, dtype=np.uint16, chunks=(1, 1, 100, 100, 3))
    refused(stored, r"'views' does not lie whole in this file, it holds 0 of \d+ bytes")


def test_views_compressed_to_nothing(stored: Path) -> None:
    replace_views(stored, shape=HUGE, dtype=np.uint16, chunks=(1, 1, 400, 400, 3), compression="gzip")
    refused(stored, r"says that its \d+ bytes hold 32400000000, expected at most 268435456")


def test_chunks_larger_than_their_array(stored: Path) -> None:
    shape = SMALL.shape
    replace_views(
        stored, shape=shape, maxshape=(None,) * 5, dtype=np.uint16, chunks=(15, 15, 1000, 1500, 3), compression="gzip"
    )
    refused(stored, "has chunks of")


def test_views_in_another_file(stored: Path, tmp_path: Path) -> None:
    (tmp_path / "other.h5").write_bytes(stored.read_bytes())
    with h5py.File(stored, "r+") as file:
        del file["views"]
        file["views"] = h5py.ExternalLink("other.h5", "/views")
    refused(stored, "'views' does not lie in this file")


def test_text_beside_the_views_of_a_mat_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write_decoded_mat(path, LightField(SMALL.astype(np.float32), None, None, "B51", "a"))
    with h5py.File(path, "r+") as file:
        del file["lfstereo"]
        file.create_dataset("lfstereo", shape=(10**10, 1), dtype=np.uint16, chunks=(1000, 1))
    refused(path, "'lfstereo' does not lie whole in this file")


def test_compressed_mat_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a limit of 1 MiB instead of 256, so that the test is short."""
    for module in (expansion, mat5):
        monkeypatch.setattr(module, "ALWAYS_ALLOWED_BYTES", 1 << 20)
    path, packed = tmp_path / "a.mat", zlib.compress(bytes(3 << 20))
    path.write_bytes(bytes(126) + b"IM" + struct.pack("<II", 15, len(packed)) + packed)
    refused(path, r"a\.mat: says that its \d+ bytes hold 1048577, expected at most 1048576")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda file: file["views"].attrs.__setitem__("encoding", np.zeros(3)), "'views' has encoding"),
        (lambda file: file.attrs.__setitem__("colour_space", np.zeros(3)), "found colour space"),
        (lambda file: file.attrs.__setitem__("format", h5py.Empty("f")), "found no text 'format'"),
        (lambda file: (file.__delitem__("views"), file.create_dataset("views", dtype="f", shape=None)), "is no array"),
        (lambda file: (file.__delitem__("views"), file.create_group("views")), "is no array of numbers"),
    ],
)
def test_attributes_of_another_kind(stored: Path, damage: Callable[[Any], object], message: str) -> None:
    with h5py.File(stored, "r+") as file:
        damage(file)
    refused(stored, message)
