"""Finding the raw frame, or saying why there is none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lfstereo.container import Capture, read_capture, write_capture
from lfstereo.container import capture as capture_module
from lfstereo.container.layouts import f01_toc, public_metadata
from lfstereo.container.writer import reference, write_container
from lfstereo.errors import ContainerError


def test_image_file_is_pointed_to_the_camera_option(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match=r"found an image file.*name its camera \(--camera lytro-f01"):
        read_capture(tmp_path / "IMG_1.jpg")


def test_unknown_suffix(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match=r"found the suffix '\.mp4', expected \.LFR, \.LFP or \.RAW"):
        read_capture(tmp_path / "a.mp4")


@pytest.mark.parametrize("suffix", [".TXT", ".txt", ".json", ".JSON"])
def test_metadata_of_a_bare_frame_under_any_suffix(tmp_path: Path, illum_capture: Capture, suffix: str) -> None:
    write_capture(tmp_path / "a.RAW", illum_capture)
    (tmp_path / "a.TXT").rename(tmp_path / f"a{suffix}")
    assert read_capture(tmp_path / "a.RAW").metadata == illum_capture.metadata


def test_bare_frame_without_its_metadata(tmp_path: Path) -> None:
    (tmp_path / "a.RAW").write_bytes(bytes(10))
    with pytest.raises(ContainerError, match=r"a\.RAW: found no metadata beside it, expected a\.TXT or a\.json"):
        read_capture(tmp_path / "a.RAW")


def test_bare_frame_of_the_wrong_size(tmp_path: Path, illum_capture: Capture) -> None:
    write_capture(tmp_path / "a.RAW", illum_capture)
    (tmp_path / "a.RAW").write_bytes(bytes(2399))
    with pytest.raises(ContainerError, match="found a raw frame of 2399 bytes, expected 2400 for 48 x 40 pixels of 10"):
        read_capture(tmp_path / "a.RAW")


def test_bare_frame_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match=r"a\.RAW: cannot be read \(No such file"):
        read_capture(tmp_path / "a.RAW")


def test_metadata_beside_that_are_too_large_or_unreadable(
    tmp_path: Path, illum_capture: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_capture(tmp_path / "a.RAW", illum_capture)
    with monkeypatch.context() as patch:
        patch.setattr(capture_module, "LARGEST_JSON_BYTES", 10)
        with pytest.raises(ContainerError, match=r"a\.TXT: found \d+ bytes, expected metadata of at most 10"):
            read_capture(tmp_path / "a.RAW")

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(ContainerError, match=r"a\.TXT: cannot be read \(Permission denied\)"):
        read_capture(tmp_path / "a.RAW")


def test_raw_section_of_the_wrong_size(tmp_path: Path, f01_capture: Capture) -> None:
    raw, public = bytes(2999), json.dumps(public_metadata(f01_capture.metadata)).encode()
    toc = f01_toc(f01_capture.metadata, {"imageRef": reference(raw), "metadataRef": reference(public)})
    write_container(tmp_path / "a.lfp", toc, [raw, public])
    with pytest.raises(ContainerError, match="found a raw frame of 2999 bytes, expected 3000 for 50 x 40 pixels of 12"):
        read_capture(tmp_path / "a.lfp")


@pytest.mark.parametrize("key", ["imageRef", "metadataRef", "privateMetadataRef"])
def test_reference_without_its_section_is_named(tmp_path: Path, f01_capture: Capture, key: str) -> None:
    raw, public = bytes(3000), json.dumps(public_metadata(f01_capture.metadata)).encode()
    parts = {"imageRef": raw, "metadataRef": public, "privateMetadataRef": b"{}"}
    toc = f01_toc(f01_capture.metadata, {name: reference(data) for name, data in parts.items()})
    write_container(tmp_path / "a.lfp", toc, [data for name, data in parts.items() if name != key])
    size = (tmp_path / "a.lfp").stat().st_size
    with pytest.raises(
        ContainerError, match=f"byte {size}: the file ends here, expected the section 'sha1-.*frame's {key}"
    ):
        read_capture(tmp_path / "a.lfp")


@pytest.mark.parametrize("toc", [{"views": []}, {"frames": [{"frame": {}}]}, {"frames": [{"frame": {"imageRef": 5}}]}])
def test_table_of_contents_without_a_raw_frame(tmp_path: Path, toc: dict[str, object]) -> None:
    write_container(tmp_path / "a.lfp", toc, [])
    with pytest.raises(ContainerError, match="found a table of contents without a frame's imageRef, expected one"):
        read_capture(tmp_path / "a.lfp")


def test_processed_picture_says_what_it_is(tmp_path: Path) -> None:
    images = [b"\xff\xd8" + bytes([n]) for n in range(3)]
    depth = np.zeros((2, 5), np.float32).tobytes()
    item = {
        "kind": "focusStack",
        "perImage": [{"imageRef": reference(data), "focus": n} for n, data in enumerate(images)],
        "depthMap": {"imageRef": reference(depth), "width": 5, "height": 2},
    }
    write_container(tmp_path / "a.lfp", {"views": [{"accelerations": [item]}]}, [*images, depth])
    message = (
        r"a processed picture \(focusStack\) with 3 JPEG focal-stack images, a depth map 5 x 2 float32, no raw lens"
    )
    with pytest.raises(ContainerError, match=message):
        read_capture(tmp_path / "a.lfp")
    write_container(tmp_path / "b.lfp", {"views": [{"accelerations": [{"kind": "web"}]}]}, [])
    with pytest.raises(ContainerError, match=r"a processed picture \(web\) with no images, no raw lenslet image"):
        read_capture(tmp_path / "b.lfp")


def test_raw_frame_beside_what_was_computed_from_it_is_read(tmp_path: Path, f01_capture: Capture) -> None:
    from lfstereo.container.packing import pack

    public = json.dumps(public_metadata(f01_capture.metadata)).encode()
    raw = pack(f01_capture.mosaic, 12, "big", "x").tobytes()
    toc = f01_toc(f01_capture.metadata, {"imageRef": reference(raw), "metadataRef": reference(public)})
    computed = {"type": "com.lytro.acceleration.depthMap", "vendorContent": {"depthMap": {"imageRef": reference(b"D")}}}
    toc["picture"]["accelerationArray"] = [computed]
    write_container(tmp_path / "a.lfp", toc, [raw, public, b"D"])
    assert np.array_equal(read_capture(tmp_path / "a.lfp").mosaic, f01_capture.mosaic)
    write_container(tmp_path / "cut.lfp", toc, [public], toc_first=True)
    with pytest.raises(ContainerError, match=r"the file ends here, expected the section .* frame's imageRef"):
        read_capture(tmp_path / "cut.lfp")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("f01_depth_map.lfp", r"a processed picture \(depthMap\) with a depth map 330 x 330 float32, a confidence map"),
        (
            "f01_raw_truncated.lfp",
            "byte 4400: the file ends here, expected the section 'sha1-0360f825e6eed3c7c470fb79a7",
        ),
        (
            "illum_processed.LFP",
            r"a processed picture \(focusStack\) with 10 JPEG focal-stack images, a depth map 88 x 60",
        ),
        ("illum_stack.lfp", r"a processed picture \(edofWarp\) with 7 images in files beside it, no raw lenslet image"),
    ],
)
def test_real_files_without_a_raw_frame(real_data: Path, name: str, message: str) -> None:
    with pytest.raises(ContainerError, match=message):
        read_capture(real_data / "containers" / name)
