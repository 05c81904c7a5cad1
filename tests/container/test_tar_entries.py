"""Tar archives of every kind that programs write, and heads that lie."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import pytest

from lfstereo.container.members import list_members
from lfstereo.container.tar_entries import tar_entries
from lfstereo.errors import ContainerError

DATA = bytes(range(200)) * 4


def write_tar(path: Path, names: list[str], form: int = tarfile.USTAR_FORMAT, **fields: object) -> Path:
    with tarfile.open(path, "w", format=form) as archive:
        for name in names:
            entry = tarfile.TarInfo(name)
            entry.size = len(DATA)
            for key, value in fields.items():
                setattr(entry, key, value)
            archive.addfile(entry, io.BytesIO(DATA))
    return path


def set_field(path: Path, at: int, value: bytes, sum_right: bool = True) -> Path:
    """Overwrite a field of the first head, and make its checksum right."""
    data = bytearray(path.read_bytes())
    data[at : at + len(value)] = value
    if sum_right:
        data[148:156] = b" " * 8
        data[148:156] = b"%06o\0 " % sum(data[:512])
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("form", [tarfile.USTAR_FORMAT, tarfile.GNU_FORMAT, tarfile.PAX_FORMAT])
def test_names_places_and_lengths(tmp_path: Path, form: int) -> None:
    names = ["unitdata/MOD_0001.RAW", "d" * 90 + "/" + "e" * 90, "ä.TXT"]
    path = write_tar(tmp_path / "a.tar", names, form)
    found = list(tar_entries(path))
    assert [entry.name for entry in found] == names
    data = path.read_bytes()
    assert all(data[entry.offset : entry.offset + entry.length] == DATA for entry in found)


def test_size_in_an_extended_head_and_in_base_256(tmp_path: Path) -> None:
    path = write_tar(tmp_path / "a.tar", ["a"], tarfile.PAX_FORMAT, pax_headers={"size": str(len(DATA))})
    assert [entry.length for entry in tar_entries(path)] == [len(DATA)]
    path = set_field(write_tar(tmp_path / "b.tar", ["a"]), 124, b"\x80" + len(DATA).to_bytes(11, "big"))
    assert [entry.length for entry in tar_entries(path)] == [len(DATA)]


def test_folders_and_links_are_passed_over_and_the_end_may_be_missing(tmp_path: Path) -> None:
    path = write_tar(tmp_path / "a.tar", ["a", "b"], type=tarfile.SYMTYPE, linkname="/etc/passwd", size=0)
    assert list(tar_entries(path)) == []
    path = write_tar(tmp_path / "b.tar", ["a"])
    path.write_bytes(path.read_bytes()[: 512 + 1024])
    assert len(list(tar_entries(path))) == 1


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        (0, b"b", r"found checksum \d+, expected \d+: no tar head"),
        (124, b"77777777777\0", "bytes up to the end, expected 8589934591"),
        (124, b"\xff" * 12, "bytes up to the end, expected "),
        (124, b"0000000089x\0", "expected an octal number"),
        (156, b"S", "stored with holes"),
        (156, b"L", "name or extended head of 70000 bytes"),
        (156, b"x", "expected 'length key=value'"),
    ],
)
def test_heads_that_lie(tmp_path: Path, at: int, value: bytes, message: str) -> None:
    path = write_tar(tmp_path / "a.tar", ["a"])
    if value == b"L":
        path.write_bytes(path.read_bytes() + bytes(70_000))
        set_field(path, 124, b"%011o\0" % 70_000)
    set_field(path, at, value, sum_right=at != 0)
    with pytest.raises(ContainerError, match=message):
        list(tar_entries(path))


@pytest.mark.parametrize(
    ("record", "message"), [(b"12 size=-5x\n", "found size b'-5x'"), (b"22 GNU.sparse.major=1\n", "stored with holes")]
)
def test_extended_heads_that_lie(tmp_path: Path, record: bytes, message: str) -> None:
    path = write_tar(tmp_path / "a.tar", ["a"])
    data = path.read_bytes()
    path.write_bytes(data[:512] + record.ljust(512, b"\0") + data)
    set_field(path, 124, b"%011o\0" % len(record))
    set_field(path, 156, b"x")
    with pytest.raises(ContainerError, match=message):
        list(tar_entries(path))


def test_more_entries_than_any_camera_has(tmp_path: Path) -> None:
    head = write_tar(tmp_path / "a.tar", ["a"], size=0).read_bytes()[:512]
    (tmp_path / "a.tar").write_bytes(head * 10_001)
    with pytest.raises(ContainerError, match="more than 10000 entries"):
        list(tar_entries(tmp_path / "a.tar"))


@pytest.mark.parametrize("name", ["../../etc/passwd", "a\nb", "x" * 2000, "a/../../b"])
def test_names_that_lead_outside_or_break_a_line(tmp_path: Path, name: str) -> None:
    path = write_tar(tmp_path / "a.tar", [name], tarfile.PAX_FORMAT)
    with pytest.raises(ContainerError, match="expected a path inside the archive") as caught:
        list(list_members(path))
    assert "\n" not in str(caught.value)
