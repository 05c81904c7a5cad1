"""Results appear whole or not at all."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from lfstereo.errors import OutputError
from lfstereo.outputs import atomic_file, atomic_folder, check_space


def test_file_appears_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with atomic_file(target) as scratch:
        scratch.write_text("whole")
        assert not target.exists()
    assert target.read_text() == "whole"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_folder_replaces_only_when_forced(tmp_path: Path) -> None:
    target = tmp_path / "out"
    for force, text in ((False, "one"), (True, "two")):
        with atomic_folder(target, force=force) as scratch:
            (scratch / f"{text}.txt").write_text(text)
    assert [p.name for p in target.iterdir()] == ["two.txt"]
    with pytest.raises(OutputError, match=r"exists already.*--force"), atomic_folder(target):
        pytest.fail("must refuse before any work")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_disk_full_leaves_nothing_and_keeps_the_old(tmp_path: Path, number: int) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (target / "old").touch()
    with pytest.raises(OutputError, match="disk is full"), atomic_folder(target, force=True) as scratch:
        (scratch / "half").touch()
        raise OSError(number, "no space")
    assert [p.name for p in tmp_path.rglob("*")] == ["out", "old"]


def test_read_only_place(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"), atomic_folder(tmp_path / "file" / "out"):
        pytest.fail("must refuse before any work")


def test_file_where_a_folder_is_meant_and_the_reverse(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="is a file"), atomic_folder(tmp_path / "file", force=True):
        pytest.fail("must refuse before any work")
    with pytest.raises(OutputError, match="is a folder"), atomic_file(tmp_path / "folder", force=True):
        pytest.fail("must refuse before any work")


def test_an_error_inside_passes_through_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "out") as scratch:
        (scratch / "half").touch()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_no_room_for_a_large_file(tmp_path: Path) -> None:
    check_space(tmp_path / "new" / "small.h5", 1)
    with pytest.raises(OutputError, match=r"large\.h5: the disk is full; needs 1125899906842624 MiB"):
        check_space(tmp_path / "new" / "large.h5", 2**70)


def test_a_file_inside_a_folder_is_named_by_its_final_place(tmp_path: Path) -> None:
    message = str(tmp_path / "out" / "a.txt")
    with (
        pytest.raises(OutputError, match=message),
        atomic_folder(tmp_path / "out") as scratch,
        atomic_file(scratch / "a.txt"),
    ):
        raise OSError(errno.ENOSPC, "no space")
