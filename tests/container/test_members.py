"""Files inside folders, tar archives and backup volumes: the same bytes, wherever they lie."""

from __future__ import annotations

import io
import json
import tarfile
from pathlib import Path

import pytest

from lfstereo.container.members import list_members
from lfstereo.container.writer import reference, write_container
from lfstereo.errors import ContainerError

RAW, TEXT = bytes(range(256)) * 3, b'{"a": 1}'


def write_tar(path: Path, files: dict[str, bytes]) -> Path:
    with tarfile.open(path, "w") as archive:
        for name, data in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
    return path


def write_volume(path: Path, files: dict[str, bytes], following: str = "") -> Path:
    listed = [{"name": name, "dataRef": reference(data)} for name, data in files.items()]
    toc = {"files": listed} | ({"nextFile": following} if following else {})
    write_container(path, toc, list(files.values()), toc_first=True)
    return path


def contents(place: Path) -> dict[str, bytes]:
    return {member.name: member.read() for member in list_members(place)}


def test_folder(tmp_path: Path) -> None:
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "b" / "MOD_0001.RAW").write_bytes(RAW)
    (tmp_path / "MOD_0001.TXT").write_bytes(TEXT)
    (tmp_path / ".MOD_0002.RAW.1a2b3c4d.partial").write_bytes(RAW)
    assert contents(tmp_path) == {"a/b/MOD_0001.RAW": RAW, "MOD_0001.TXT": TEXT}


def test_tar_inside_a_folder(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    write_tar(tmp_path / "x" / "caldata-B1.tar", {"unitdata/MOD_0001.RAW": RAW, "./unitdata/MOD_0001.TXT": TEXT})
    assert contents(tmp_path) == {"x/unitdata/MOD_0001.RAW": RAW, "x/unitdata/MOD_0001.TXT": TEXT}


def test_backup_volumes(tmp_path: Path) -> None:
    write_volume(tmp_path / "data.C.0", {"C:\\T1CALIB\\MOD_0002.RAW": RAW}, following="data.C.1")
    write_volume(tmp_path / "data.C.1", {"C:\\T1CALIB\\MOD_0002.TXT": TEXT, "C:\\EMPTY.TXT": b""})
    assert contents(tmp_path) == {"T1CALIB/MOD_0002.RAW": RAW, "T1CALIB/MOD_0002.TXT": TEXT, "EMPTY.TXT": b""}
    assert contents(tmp_path / "data.C.0") == {"T1CALIB/MOD_0002.RAW": RAW}


def test_missing_volume(tmp_path: Path) -> None:
    write_volume(tmp_path / "data.C.0", {"C:\\A.TXT": TEXT}, following="data.C.1")
    with pytest.raises(ContainerError, match=r"volume 'data\.C\.1' follows, which is missing"):
        contents(tmp_path)


def test_volume_cut_off_after_a_whole_section(tmp_path: Path) -> None:
    volume = write_volume(tmp_path / "data.C.0", {"C:\\A.RAW": RAW, "C:\\B.TXT": TEXT})
    data = volume.read_bytes()
    volume.write_bytes(data[: data.rindex(b"\x89LFC")])
    with pytest.raises(ContainerError, match="the file ends here, expected the section of"):
        contents(volume)


@pytest.mark.parametrize(
    ("toc", "message"),
    [({"picture": {}}, "without 'files'"), ({"files": [{"name": "A"}]}, "without name or dataRef")],
)
def test_volume_without_a_list_of_files(tmp_path: Path, toc: dict[str, object], message: str) -> None:
    write_container(tmp_path / "data.C.0", toc, [RAW], toc_first=True)
    with pytest.raises(ContainerError, match=message):
        contents(tmp_path)


def test_damaged_volume(tmp_path: Path) -> None:
    volume = write_volume(tmp_path / "data.C.0", {"C:\\A.RAW": RAW})
    data = bytearray(volume.read_bytes())
    data[data.index(RAW) + 5] ^= 1
    volume.write_bytes(data)
    with pytest.raises(ContainerError, match="another SHA-1"):
        contents(volume)


def test_file_that_became_shorter(tmp_path: Path) -> None:
    tar = write_tar(tmp_path / "a.tar", {"A.RAW": RAW})
    members = list(list_members(tar))
    tar.write_bytes(tar.read_bytes()[:700])
    with pytest.raises(ContainerError, match="found 188 bytes, expected 768"):
        members[0].read()
    tar.unlink()
    with pytest.raises(ContainerError, match="cannot be read"):
        members[0].read()


def test_no_tar(tmp_path: Path) -> None:
    (tmp_path / "a.tar").write_bytes(b"no archive" * 100)
    with pytest.raises(ContainerError, match="expected an octal number; copy the archive again"):
        contents(tmp_path)
    with pytest.raises(ContainerError, match="cannot be read"):
        contents(tmp_path / "b.tar")


def test_other_files_are_no_archives(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(json.dumps({}).encode())
    with pytest.raises(ContainerError, match="found no archive"):
        contents(tmp_path / "a.zip")


@pytest.mark.parametrize("name", ["../A.RAW", "C:\\..\\A.RAW"])
def test_names_that_leave_the_archive(tmp_path: Path, name: str) -> None:
    write_volume(tmp_path / "data.C.0", {name: RAW})
    with pytest.raises(ContainerError, match="expected a path inside the archive"):
        contents(tmp_path)
