"""What `describe` says of whole, damaged and foreign files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfstereo.container import Capture, write_capture
from lfstereo.container.contents import jpeg_size
from lfstereo.container.describe import describe
from lfstereo.container.writer import reference, write_container
from lfstereo.errors import ContainerError, MetadataError


def test_illum_container(tmp_path: Path, illum_capture: Capture) -> None:
    write_capture(tmp_path / "a.LFR", illum_capture)
    found = describe(tmp_path / "a.LFR")
    assert (found.what, found.has_raw, found.missing) == ("a raw capture of a Lytro ILLUM", True, ())
    assert found.metadata == illum_capture.metadata
    assert found.size == (tmp_path / "a.LFR").stat().st_size
    assert all(section.intact for section in found.sections)
    whats = [section.what for section in found.sections]
    assert whats[:4] == [
        "raw lenslet image",
        "JSON metadata",
        "JSON metadata, private (serial numbers)",
        "list of hot pixels",
    ]
    assert whats[-2:] == ["JPEG 704 x 480, thumbnail", "table of contents, JSON"]
    assert found.sections[0].length == 2400


def test_white_dark_and_bare_frames(tmp_path: Path, f01_capture: Capture) -> None:
    for kind, text in (("is_white_image", "a white image"), ("is_dark_frame", "a dark frame")):
        capture = replace(f01_capture, metadata=replace(f01_capture.metadata, **{kind: True}))
        write_capture(tmp_path / "a.lfp", capture, force=True)
        write_capture(tmp_path / "a.RAW", capture, force=True)
        assert describe(tmp_path / "a.lfp").what == f"{text} of a Lytro F01"
        bare = describe(tmp_path / "a.RAW")
        assert bare.what == f"{text} of a Lytro F01, bare frame with its metadata beside it"
        assert (bare.metadata, bare.sections, bare.size) == (capture.metadata, (), 3000)


def test_damaged_sections_are_reported(tmp_path: Path, illum_capture: Capture) -> None:
    path = tmp_path / "a.LFR"
    write_capture(path, illum_capture)
    sections = describe(path).sections
    for number, has_metadata in ((0, True), (1, False), (10, True)):
        write_capture(path, illum_capture, force=True)
        bad = bytearray(path.read_bytes())
        bad[sections[number].offset + 100] ^= 2
        path.write_bytes(bad)
        found = describe(path)
        assert [i for i, section in enumerate(found.sections) if not section.intact] == [number]
        assert (found.metadata is not None) == has_metadata
        assert found.what == (
            "a raw capture of a Lytro ILLUM" if has_metadata else "a raw capture with damaged metadata"
        )


def test_sections_of_every_kind(tmp_path: Path) -> None:
    data = {
        "frame": b"raw",
        "perImage": b"\xff\xd8\xff\xc0\x00\x0b\x08\x00\x03\x00\x05\x01",
        "depthMap": bytes(8),
        "confidenceMap": bytes(3),
        "spare": b"[1]",
        "edge": b"\x89PNG",
    }
    refs = {key: {"imageRef": reference(value)} for key, value in data.items()}
    maps = {
        "width": 2,
        "height": 1,
        "depthMap": refs["depthMap"],
        "confidenceMap": {**refs["confidenceMap"], "width": "?"},
    }
    item = {"kind": "focusStack", "perImage": [{**refs["perImage"], "focus": -1.5}], **maps}
    toc = {"frames": [{"frame": {"whiteFieldRef": reference(data["edge"])}}], "views": [{"accelerations": [item]}]}
    write_container(
        tmp_path / "a.lfp", toc, [data[key] for key in ("perImage", "depthMap", "confidenceMap", "spare", "edge")]
    )
    found = describe(tmp_path / "a.lfp")
    assert [section.what for section in found.sections] == [
        "JPEG 5 x 3, focused at lambda -1.5",
        "depth map 2 x 1 float32",
        "confidence map of unknown size",
        "JSON, not referred to",
        "white field (PNG)",
        "table of contents, JSON",
    ]
    assert not found.has_raw


@pytest.mark.parametrize(
    "data", [b"", b"\xff\xd8", b"\xff\xd8\xff\xe0\x00\x00", b"\xff\xd8\xff\xe0\xff\xff" + bytes(9)]
)
def test_jpeg_without_a_frame_header(data: bytes) -> None:
    assert jpeg_size(data) is None


def test_no_picture_at_all(tmp_path: Path) -> None:
    write_container(tmp_path / "a.lfp", {"views": []}, [])
    with pytest.raises(ContainerError, match="without a frame's imageRef"):
        describe(tmp_path / "a.lfp")


def test_raw_frame_whose_metadata_are_missing_or_unusable(tmp_path: Path) -> None:
    toc = {"frames": [{"frame": {"imageRef": reference(b"raw"), "metadataRef": reference(b"{}")}}]}
    write_container(tmp_path / "a.lfp", toc, [b"raw"])
    with pytest.raises(ContainerError, match="frame's metadataRef"):
        describe(tmp_path / "a.lfp")
    write_container(tmp_path / "b.lfp", toc, [b"raw", b"{}"])
    with pytest.raises(MetadataError, match="field 'image' is missing"):
        describe(tmp_path / "b.lfp")


def test_raw_frame_of_the_wrong_size(tmp_path: Path, illum_capture: Capture) -> None:
    write_capture(tmp_path / "a.RAW", illum_capture)
    (tmp_path / "a.RAW").write_bytes(bytes(5))
    with pytest.raises(ContainerError, match="found a raw frame of 5 bytes, expected 2400"):
        describe(tmp_path / "a.RAW")
    with pytest.raises(ContainerError, match=r"none\.RAW: cannot be read"):
        describe(tmp_path / "none.RAW")


def test_real_files(real_data: Path) -> None:
    folder = real_data / "containers"
    depth = describe(folder / "f01_depth_map.lfp")
    assert depth.metadata is None
    assert len(depth.missing) == 3
    assert depth.what.endswith("with a depth map 330 x 330 float32, a confidence map 330 x 330 float32")
    processed = describe(folder / "illum_processed.LFP")
    assert processed.metadata is not None
    assert (processed.metadata.serial, processed.metadata.lens.zoom_step) == ("45142500380", 123)
    assert [s.what for s in processed.sections][:3] == [
        "table of contents, JSON",
        "depth map 88 x 60 float32",
        "JPEG 704 x 480, focused at lambda 1.5",
    ]
    stack = describe(folder / "illum_stack.lfp")
    assert stack.metadata is not None
    assert (stack.metadata.serial, stack.metadata.awb_cct_k, len(stack.metadata.ccm_by_cct)) == (
        "B5144709880",
        5500.0,
        3,
    )
    assert stack.missing == ("frames[0].frame.imageRef",)
    assert all(s.intact for found in (depth, processed, stack) for s in found.sections)
    with pytest.raises(ContainerError, match="byte 4400: the file ends here, expected the section 'sha1-0360"):
        describe(folder / "f01_raw_truncated.lfp")
