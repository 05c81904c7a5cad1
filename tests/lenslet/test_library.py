"""White images in folders, tar archives and backup volumes make the same library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from lfstereo.container import Capture
from lfstereo.errors import AssetError, ContainerError
from lfstereo.lenslet.library import open_library
from lfstereo.lenslet.white import find_white_image

HOT = [(5, 7), (219, 199)]


@pytest.mark.parametrize("form", ["folder", "tar", "volumes"])
def test_same_library_in_every_form(
    tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture, form: str
) -> None:
    folder = tmp_path / "camera"
    camera_files.put(folder, "MOD_0002", small_white, zoom=-100, focus=10, serial="WRONG")
    camera_files.put(folder, "MOD_0003", small_white, zoom=300, focus=20, serial="WRONG")
    camera_files.put_factory_files(folder, "B51", {"MOD_0002": "sha1-AA", "MOD_0003": "sha1-bb"}, HOT)
    place = camera_files.pack[form](folder, tmp_path / ("packed.tar" if form == "tar" else "packed"))
    library = open_library(place)
    assert not library.problems
    assert [(w.serial, w.zoom_step, w.focus_step) for w in library.whites] == [("B51", -100, 10), ("B51", 300, 20)]
    first = library.whites[0]
    assert first.references == ("sha1-aa",)
    bad = first.bad_pixels()
    assert bad is not None and bad.tolist() == [list(pair) for pair in HOT]
    assert first.factory_lattices()[0].step_x_px == (14.3, 0.02)
    read = first.read()
    assert (read.mosaic == small_white.mosaic).all()
    assert read.metadata.serial == "B51"
    assert open_library(place) == library
    found = find_white_image(place, camera_files.asked(small_white, zoom=200, serial="B51"))
    assert found.metadata.lens.zoom_step == 300


def test_picture_that_names_its_white_image(
    tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture
) -> None:
    camera_files.put(tmp_path, "MOD_0001", small_white, zoom=0)
    camera_files.put(tmp_path, "MOD_0002", small_white, zoom=500)
    camera_files.put_factory_files(tmp_path, "SIM1", {"mod_0002": "sha1-cc"}, [])
    picture = camera_files.asked(small_white, zoom=0, geometry_ref="sha1-cc")
    assert open_library(tmp_path).of_camera(picture)[0].zoom_step == 500
    assert open_library(tmp_path).of_camera(replace(picture, geometry_ref=""))[0].zoom_step == 0


def test_each_camera_has_its_own_files(tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture) -> None:
    for serial, hot in (("SIM1", [(1, 2)]), ("SIM2", [(3, 4)])):
        camera_files.put(tmp_path / serial / "whites", "MOD_0001", small_white, serial="")
        camera_files.put_factory_files(tmp_path / serial, serial, {}, hot)
    found = {white.serial: white.bad_pixels() for white in open_library(tmp_path).whites}
    assert {s: b.tolist() for s, b in found.items() if b is not None} == {"SIM1": [[1, 2]], "SIM2": [[3, 4]]}


def test_without_factory_files(tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture) -> None:
    camera_files.put(tmp_path, "MOD_0001", small_white)
    (white,) = open_library(tmp_path).whites
    assert white.bad_pixels() is None and white.factory_lattices() == ()


def test_index_follows_changes(tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture) -> None:
    camera_files.put(tmp_path, "MOD_0001", small_white)
    assert len(open_library(tmp_path).whites) == 1
    camera_files.put(tmp_path, "MOD_0002", small_white)
    assert len(open_library(tmp_path).whites) == 2
    (tmp_path / "MOD_0002.TXT").unlink()
    library = open_library(tmp_path)
    assert len(library.whites) == 1
    assert "found no metadata beside it" in library.problems[0]


def test_damaged_archive_is_refused(tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture) -> None:
    camera_files.put(tmp_path / "a", "MOD_0001", small_white)
    tar = camera_files.pack["tar"](tmp_path / "a", tmp_path / "a.tar")
    tar.write_bytes(tar.read_bytes()[:-30000])
    with pytest.raises(ContainerError, match="copy the archive again"):
        open_library(tar)


def test_index_holds_from_another_working_folder(
    tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera_files.put(tmp_path / "here" / "whites", "MOD_0001", small_white)
    monkeypatch.chdir(tmp_path / "here")
    assert len(open_library(Path("whites")).whites) == 1
    monkeypatch.chdir(tmp_path)
    (white,) = open_library(Path("here/whites")).whites
    assert (white.read().mosaic == small_white.mosaic).all()


def test_a_file_is_no_library(tmp_path: Path) -> None:
    (tmp_path / "a.zip").touch()
    with pytest.raises(AssetError, match="found no such folder"):
        open_library(tmp_path / "a.zip")
