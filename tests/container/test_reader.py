"""Containers in any order, and damage to any byte."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lfstereo.container import Capture, read_capture, read_container, write_capture
from lfstereo.container import reader as reader_module
from lfstereo.container.describe import describe
from lfstereo.container.format import EMPTY_SHA1, FILE_HEAD, section_bytes
from lfstereo.container.layouts import f01_toc, private_metadata, public_metadata
from lfstereo.container.packing import pack
from lfstereo.container.reader import parse_json
from lfstereo.container.writer import reference
from lfstereo.errors import ContainerError, InputError, LfstereoError


def f01_parts(capture: Capture) -> tuple[list[tuple[str, bytes]], dict[str, object]]:
    """Return the content sections of a capture and its table of contents."""
    m = capture.metadata
    raw = pack(capture.mosaic, m.bits_per_pixel, m.endianness, "x").tobytes()
    texts = [json.dumps(tree).encode() for tree in (public_metadata(m), private_metadata(m))]
    parts = dict(zip(("imageRef", "metadataRef", "privateMetadataRef"), (raw, *texts), strict=True))
    toc = f01_toc(m, {key: reference(data) for key, data in parts.items()})
    return [("content", data) for data in parts.values()], toc


def assemble(path: Path, sections: list[tuple[str, bytes]]) -> Path:
    """Write a container section by section."""
    pieces = [piece for kind, data in sections for piece in section_bytes(kind, data)]  # type: ignore[arg-type]
    path.write_bytes(FILE_HEAD + b"".join(pieces))
    return path


@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize("indent", [None, 2])
def test_sections_in_any_order_and_json_on_one_line(
    tmp_path: Path, f01_capture: Capture, place: int, indent: int | None
) -> None:
    contents, toc = f01_parts(f01_capture)
    sections = contents[::-1]
    sections.insert(place, ("toc", json.dumps(toc, indent=indent).encode()))
    found = read_capture(assemble(tmp_path / "a.lfp", sections))
    assert np.array_equal(found.mosaic, f01_capture.mosaic)
    assert found.metadata == f01_capture.metadata


def test_several_tables_unknown_and_empty_sections_and_long_padding(tmp_path: Path, f01_capture: Capture) -> None:
    contents, toc = f01_parts(f01_capture)
    sections = [
        ("toc", b'{"else": 1}'),
        ("content", b""),
        *contents,
        ("toc", json.dumps(toc).encode()),
        ("content", b"?"),
    ]
    path = assemble(tmp_path / "a.lfp", sections)
    path.write_bytes(path.read_bytes() + bytes(70_000))
    container = read_container(path)
    assert container.toc == toc
    assert [section.length for section in container.sections][:2] == [11, 0]
    assert container.sections[1].sha1 == EMPTY_SHA1
    assert container.read(container.sections[1]) == b""
    assert np.array_equal(read_capture(path).mosaic, f01_capture.mosaic)


def test_metadata_inside_the_table_of_contents(tmp_path: Path, illum_capture: Capture) -> None:
    m = illum_capture.metadata
    raw = pack(illum_capture.mosaic, 10, "little", "x").tobytes()
    frame = {"metadata": public_metadata(m), "privateMetadata": private_metadata(m), "imageRef": reference(raw)}
    toc = json.dumps({"frames": [{"frame": frame}], "views": []}).encode()
    assert read_capture(assemble(tmp_path / "a.lfr", [("toc", toc), ("content", raw)])).metadata == m


def test_offsets_and_names(tmp_path: Path, illum_capture: Capture) -> None:
    path = tmp_path / "a.LFR"
    write_capture(path, illum_capture)
    container = read_container(path)
    assert container.size == path.stat().st_size
    assert container.sections[0].offset == 16
    assert container.sections[0].data_offset == 112
    assert [s.offset % 16 for s in container.sections] == [0] * 12
    assert [s.kind for s in container.sections] == ["content"] * 11 + ["toc"]
    assert container.find(container.sections[3].name.upper()) == container.sections[3]
    assert container.find("sha1-unknown") is None


@pytest.mark.parametrize("suffix", [".LFR", ".lfp"])
def test_a_flipped_bit_in_any_region_is_noticed(
    tmp_path: Path, illum_capture: Capture, f01_capture: Capture, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    write_capture(path, illum_capture if suffix == ".LFR" else f01_capture)
    good = path.read_bytes()
    container = read_container(path)
    places = {0, 7, 11, 12, 15, container.size - 1}
    for section in container.sections:
        head = (0, 3, 8, 11, 12, 14, 15, 16, 21, 40, 60, 61, 95, 96, 96 + section.length // 2, 95 + section.length)
        places |= {section.offset + place for place in head}
        places |= set(
            range(section.data_offset + section.length, -(-(section.data_offset + section.length) // 16) * 16)
        )
    unnoticed = []
    for place in sorted(place for place in places if place < len(good)):
        bad = bytearray(good)
        bad[place] ^= 1 << (place % 4)
        path.write_bytes(bad)
        try:
            if all(section.intact for section in describe(path).sections):
                unnoticed.append(place)
        except InputError as error:
            assert "\n" not in str(error)
            assert str(path) in str(error)
    assert not unnoticed


def test_a_flipped_bit_in_the_raw_frame_is_refused_before_use(tmp_path: Path, illum_capture: Capture) -> None:
    path = tmp_path / "a.LFR"
    write_capture(path, illum_capture)
    bad = bytearray(path.read_bytes())
    bad[500] ^= 4
    path.write_bytes(bad)
    with pytest.raises(
        ContainerError, match=r"byte 112: found 2400 bytes with SHA-1 .*, expected .*damaged, copy it again"
    ):
        read_capture(path)


@pytest.mark.parametrize("suffix", [".LFR", ".lfp"])
def test_a_file_cut_off_anywhere_is_refused(
    tmp_path: Path, illum_capture: Capture, f01_capture: Capture, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    write_capture(path, illum_capture if suffix == ".LFR" else f01_capture)
    good = path.read_bytes()
    container = read_container(path)
    last = container.sections[-1]
    bounds = [b for s in container.sections for b in (s.offset, s.offset + 16, s.data_offset, s.data_offset + s.length)]
    lengths = {0, 1, 11, 12, 15, 16, *(b + d for b in bounds for d in (-1, 0, 1)), *range(17, len(good), 997)}
    for length in sorted(n for n in lengths if n < last.data_offset + last.length):
        path.write_bytes(good[:length])
        with pytest.raises(ContainerError) as caught:
            read_capture(path)
        assert "byte " in str(caught.value)


def test_random_damage_never_crashes(tmp_path: Path, f01_capture: Capture) -> None:
    path = tmp_path / "a.lfp"
    write_capture(path, f01_capture)
    good = np.frombuffer(path.read_bytes(), np.uint8)
    random = np.random.default_rng(5)
    for _ in range(300):
        bad = good.copy()
        places = random.integers(0, len(bad), random.integers(1, 6))
        bad[places] = random.integers(0, 256, len(places))
        path.write_bytes(bad.tobytes())
        try:
            found = read_capture(path)
            assert np.array_equal(found.mosaic, f01_capture.mosaic)
        except LfstereoError as error:
            assert error.exit_code == 3


def test_length_field_larger_than_the_file_reads_nothing(tmp_path: Path, f01_capture: Capture) -> None:
    path = tmp_path / "a.lfp"
    write_capture(path, f01_capture)
    bad = bytearray(path.read_bytes())
    bad[28:32] = b"\xff\xff\xff\xff"
    path.write_bytes(bad)
    with pytest.raises(
        ContainerError, match=r"byte 16: found \d+ bytes of data .* expected 4294967295; the file is cut off"
    ):
        read_container(path)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "byte 0: found nothing, expected 89 4c 46 50 .*no Lytro container"),
        (b"\xff\xd8\xff\xe0 JPEG", "byte 0: found ff d8 ff e0 .*no Lytro container"),
        (FILE_HEAD, "byte 16: the file ends here without a table of contents"),
        (FILE_HEAD + b"\x89LFM", "byte 16: found 4 bytes up to the end of the file, expected a section's head of 16"),
        (FILE_HEAD + b"\x89LFX\r\n\x1a\n" + bytes(8), "byte 16: found 89 4c 46 58 .*expected the start of a section"),
        (FILE_HEAD + b"\x89LFM\r\n\x1a\n\0\0\0\2" + bytes(4), "byte 16: found .*expected the start of a section"),
        (FILE_HEAD + b"\x89LFM\r\n\x1a\n\0\0\0\0\0\0\0\1md5-" + bytes(100), "byte 32: found .*expected 'sha1-' and 40"),
    ],
)
def test_broken_heads(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "a.lfp"
    path.write_bytes(data)
    with pytest.raises(ContainerError, match=message):
        read_container(path)


def test_name_padding_that_is_not_zero(tmp_path: Path) -> None:
    path = assemble(tmp_path / "a.lfp", [("toc", b"{}")])
    path.write_bytes(path.read_bytes()[:80] + b"x" + path.read_bytes()[81:])
    with pytest.raises(ContainerError, match=r"byte 77: found .* expected 35 zero bytes"):
        read_container(path)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"{", "a: found no valid JSON"),
        (b"\xff\xfe{}", "a: found no valid JSON"),
        (b"[1]", "a: found JSON of type list, expected an object"),
        (b"[" * 200_000, "a: found JSON nested too deeply"),
    ],
)
def test_broken_json(data: bytes, message: str) -> None:
    with pytest.raises(ContainerError, match=message):
        parse_json(data, "a")


def test_metadata_too_large_for_any_camera(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = assemble(tmp_path / "a.lfp", [("toc", b'{"views": []}')])
    monkeypatch.setattr(reader_module, "LARGEST_JSON_BYTES", 10)
    with pytest.raises(ContainerError, match="byte 112: found 13 bytes of metadata, expected at most 10"):
        read_container(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match=r"none\.lfr: cannot be read \(No such file or directory\)"):
        read_container(tmp_path / "none.lfr")
    with pytest.raises(ContainerError, match=r"cannot be read \(Is a directory\)"):
        read_container(tmp_path)


def test_file_that_changes_between_two_readings(tmp_path: Path, f01_capture: Capture) -> None:
    path = tmp_path / "a.lfp"
    write_capture(path, f01_capture)
    container = read_container(path)
    path.write_bytes(path.read_bytes()[:1500])
    with pytest.raises(ContainerError, match="expected 3000; the file was changed while it was read"):
        container.read(container.sections[1])
    path.unlink()
    with pytest.raises(ContainerError, match="cannot be read"):
        container.read(container.sections[1])
