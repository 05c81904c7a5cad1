"""Small valid files of every format that lfstereo reads: what a fuzz run starts from."""

from __future__ import annotations

import io
import json
import struct
import tarfile
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import scipy.io

from lfstereo.assets import asset_folder
from lfstereo.container import Capture, FrameMetadata
from lfstereo.container.dng import write_dng
from lfstereo.container.fields import Json
from lfstereo.container.format import FILE_HEAD, SectionKind, section_bytes
from lfstereo.container.layouts import f01_toc, illum_toc, private_metadata, public_metadata, sidecar_metadata
from lfstereo.container.members import Member
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.container.packing import pack
from lfstereo.container.writer import reference
from lfstereo.depth.pfm import write_pfm
from lfstereo.lenslet.library import WhiteImage, WhiteLibrary, to_json
from lfstereo.lightfield import LightField, ViewSampling, write_light_field
from lfstereo.lightfield.interchange.eslf import write_eslf
from lfstereo.lightfield.interchange.lftoolbox_mat import write_decoded_mat


def captures() -> list[Capture]:
    """Return a frame of each camera, a few px large."""
    found = []
    for camera, changes in (("lytro-illum", {"exposure_s": 0.01}), ("lytro-f01", {"is_white_image": True})):
        metadata: FrameMetadata = replace(
            read_camera_profile(camera), width=4, height=2, serial="B5100000001", firmware="2.0", **changes
        )
        pixels = np.arange(8, dtype=np.uint16).reshape(2, 4) * 100
        found.append(Capture(pixels, metadata, camera))
    return found


def containers() -> list[bytes]:
    """Return an LFR of an Illum and an LFP of a first camera, as small as they can be."""
    found = []
    for capture in captures():
        m = capture.metadata
        raw = pack(capture.mosaic, m.bits_per_pixel, m.endianness, "a").tobytes()
        texts = [_compact(tree) for tree in (public_metadata(m), private_metadata(m))]
        parts = dict(zip(("imageRef", "metadataRef", "privateMetadataRef"), (raw, *texts), strict=True))
        names = {key: reference(data) for key, data in parts.items()}
        toc = illum_toc(m, names, {"imageRef": reference(raw)}) if m.model == "ILLUM" else f01_toc(m, names)
        sections: list[tuple[SectionKind, bytes]] = [("content", data) for data in parts.values()]
        sections.insert(0 if m.model == "F01" else 3, ("toc", _compact(toc)))
        found.append(FILE_HEAD + b"".join(piece for kind, data in sections for piece in section_bytes(kind, data)))
    return found


def texts() -> list[bytes]:
    """Return the text files that accompany a bare frame."""
    return [_compact(sidecar_metadata(capture.metadata)) for capture in captures()]


def publics() -> list[bytes]:
    """Return the metadata of a frame in the layout of each camera."""
    return [_compact(public_metadata(capture.metadata)) for capture in captures()]


def profiles() -> list[bytes]:
    """Return the camera profiles that come with lfstereo."""
    return [path.read_bytes() for path in sorted((asset_folder("calib") / "cameras").glob("*.toml"))]


def factory_files() -> dict[str, bytes]:
    """Return the small files beside a camera's white images, by name."""
    lattice = {
        "zoomPosition": [0],
        "focusPosition": [[0, 5]],
        **{name: [[1.5, 2.5]] for name in ("xDiskOriginPixels", "yDiskOriginPixels")},
        **{f"{a}DiskStepPixels{b}": [[14.3, 7.1]] for a in "xy" for b in "XY"},
    }
    return {
        "unit_info.json": json.dumps({"camera": {"serialNumber": "B51"}}).encode(),
        "HOTPIXEL.BIN": struct.pack("<I4H", 2, 1, 2, 3, 4),
        "mla_calibration.json": json.dumps(lattice).encode(),
        "cal_file_manifest.json": json.dumps(
            {"calibrationFiles": [{"name": "MOD_0001.GCT", "hash": "sha1-" + "a" * 40}]}
        ).encode(),
    }


def white_files() -> dict[str, bytes]:
    """Return a white image with all that lies beside it, by name."""
    m = captures()[1].metadata
    raw = pack(captures()[1].mosaic, m.bits_per_pixel, m.endianness, "a").tobytes()
    return {"MOD_0001.RAW": raw, "MOD_0001.TXT": _compact(sidecar_metadata(m))} | factory_files()


def tars() -> list[bytes]:
    """Return tar archives in the three forms that programs write."""
    found = []
    for form in (tarfile.USTAR_FORMAT, tarfile.GNU_FORMAT, tarfile.PAX_FORMAT):
        target = io.BytesIO()
        with tarfile.open(fileobj=target, mode="w", format=form) as archive:
            for name, data in white_files().items():
                long = "d" * 120 + "/" if form != tarfile.USTAR_FORMAT and name == "unit_info.json" else ""
                entry = tarfile.TarInfo(f"unitdata/{long}{name}")
                entry.size = len(data)
                archive.addfile(entry, io.BytesIO(data))
        found.append(target.getvalue().rstrip(b"\0") + bytes(512))
    return found


def volumes() -> list[bytes]:
    """Return a backup volume of the first camera."""
    files = white_files()
    listed = [{"name": f"C:\\T1CALIB\\{name}", "dataRef": reference(data)} for name, data in files.items()]
    sections: list[tuple[SectionKind, bytes]] = [("toc", _compact({"files": listed}))]
    sections += [("content", data) for data in files.values()]
    return [FILE_HEAD + b"".join(piece for kind, data in sections for piece in section_bytes(kind, data))]


def light_field(weighted: bool = True) -> LightField:
    """Return a light field of 2 x 2 views of 3 x 4 px."""
    rng = np.random.default_rng(0)
    views = rng.random((2, 2, 3, 4, 3), np.float32)
    weight = rng.integers(0, 256, views.shape[:4], dtype=np.uint8) if weighted else None
    return LightField(views, weight, ViewSampling((1.5, -2.0), (12.4, 12.3), -5e-4, 0.9), "B51", "a.LFR")


def stores(folder: Path) -> list[bytes]:
    """Return light fields as HDF5."""
    return [_written(folder / "a.h5", lambda path, w=w: write_light_field(path, light_field(w))) for w in (True, False)]


def mats(folder: Path) -> list[bytes]:
    """Return decoded light fields of every version of MAT-file."""
    codes = np.arange(3 * 3 * 2 * 2 * 3, dtype=np.uint16).reshape(3, 3, 2, 2, 3)
    found = [_written(folder / "a.mat", lambda path: write_decoded_mat(path, light_field()))]
    for compressed in (False, True):
        target = io.BytesIO()
        scipy.io.savemat(target, {"LF": codes}, do_compression=compressed)
        found.append(target.getvalue())
    return found


def pfms(folder: Path) -> list[bytes]:
    """Return a disparity as PFM, in both byte orders."""
    values = np.arange(6, dtype=np.float32).reshape(2, 3)
    little = _written(folder / "a.pfm", lambda path: write_pfm(path, values, values > 0))
    return [little, b"Pf\n# made\n3 2\n1.0\n" + values.astype(">f4").tobytes()]


def eslfs(folder: Path) -> list[bytes]:
    """Return lenslet-packed pictures."""
    return [_written(folder / "a.png", lambda path, w=w: write_eslf(path, light_field(w))) for w in (True, False)]


def dngs(folder: Path) -> list[bytes]:
    """Return mosaics as DNG."""
    return [_written(folder / "a.dng", lambda path, c=c: write_dng(path, c)) for c in captures()]


def rigs() -> list[bytes]:
    """Return the rig files that come with lfstereo."""
    return [path.read_bytes() for path in sorted((asset_folder("calib") / "rigs").glob("*.toml"))]


def descriptions() -> list[bytes]:
    """Return the text beside views, and the HCI benchmark's parameters."""
    from lfstereo.lightfield.interchange.description import to_text

    return [to_text(light_field()).encode(), b"[extrinsics]\nnum_cams_x = 2\nnum_cams_y = 2\n"]


def cards() -> list[bytes]:
    """Return the cards of the shipped models."""
    return [path.read_bytes() for path in sorted(asset_folder("models").glob("*/card.toml"))]


def safetensors() -> list[bytes]:
    """Return weights of two small tensors."""
    from safetensors.numpy import save

    return [save({"a": np.zeros((2, 3), np.float16), "b.c": np.ones(4, np.float32)})]


def caches() -> list[bytes]:
    """Return an index of white images and a grid as the cache keeps them."""
    from lfstereo.lenslet.grid import LensletGrid
    from lfstereo.lenslet.smooth_field import SmoothField

    member = Member("MOD_0001.RAW", Path("/nowhere/MOD_0001.RAW"), 0, 15, "a" * 40)
    white = WhiteImage(member, member, "B51", 1, 2, 4, 2, references=("sha1-" + "b" * 40,), hot_pixels=member)
    index = to_json(WhiteLibrary(Path("/nowhere"), (white,), ("a.RAW: damaged",)))
    grid = LensletGrid(
        origin_px=(1.0, 2.0),
        step_u_px=(14.3, 0.0),
        step_v_px=(7.1, 12.4),
        first_shifted_row=1,
        rows=3,
        columns=3,
        sensor_shape=(40, 44),
        residual_px=0.01,
        quality=0.9,
        source="white image",
        field=SmoothField(1, ((0.1, 0.2), (0.3, 0.4), (0.5, 0.6)), (40, 44)),
    )
    return [json.dumps(index).encode(), json.dumps(asdict(grid)).encode()]


def _written(path: Path, write: Callable[[Path], None]) -> bytes:
    write(path)
    data = path.read_bytes()
    path.unlink()
    return data


def _compact(value: Json) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode()
