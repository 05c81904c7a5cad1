"""Textured surfaces as binary glTF files (GLB)."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from lfstereo import __version__
from lfstereo.arrays import UInt8, check_shape
from lfstereo.depth.mesh import Mesh
from lfstereo.errors import ShapeError
from lfstereo.outputs import atomic_file

_MAGIC, _VERSION = 0x46546C67, 2
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_FLOAT, _UNSIGNED_INT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_LINEAR, _LINEAR_MIPMAP_LINEAR, _CLAMP = 9729, 9987, 33071
_GLTF_FROM_CAMERA = np.array([1.0, -1.0, -1.0], np.float32)
"""glTF's axes are x right, y up, z towards the viewer."""
_JPEG_QUALITY = 95


def write_glb(path: Path, mesh: Mesh, texture: UInt8, force: bool = False) -> None:
    """Write a textured surface as one GLB file in metres, shown as it was lit (unlit material).

    Parameters
    ----------
    path
        The file to write.
    mesh
        The surface; its axes become glTF's (x right, y up, z towards the viewer).
    texture
        ``(V, U, 3)`` sRGB picture that the surface takes its colours from; stored as JPEG.
    force
        Replace an existing file.

    Raises
    ------
    ShapeError
        If the texture is no picture, or the mesh has no triangle.
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.

    References
    ----------
    Khronos Group, "glTF 2.0 specification" (2021), sections 3.6 (buffers), 3.7 (geometry) and 4.4 (GLB);
    extension KHR_materials_unlit.
    """
    check_shape(f"{path}: texture", texture, (None, None, 3))
    if not len(mesh.triangles):
        raise ShapeError(f"{path}: found a mesh without triangles, expected at least one; check the depth's valid mask")
    points = mesh.points_m * _GLTF_FROM_CAMERA
    _, coded = cv2.imencode(".jpg", np.ascontiguousarray(texture[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    blocks = [
        points.astype("<f4").tobytes(),
        mesh.places.astype("<f4").tobytes(),
        mesh.triangles.astype("<u4").tobytes(),
        coded.tobytes(),
    ]
    views, binary = [], b""
    for block, target in zip(blocks, (_VERTICES, _VERTICES, _INDICES, None), strict=True):
        view = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(block)}
        views.append(view if target is None else view | {"target": target})
        binary += block + b"\0" * (-len(block) % 4)
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    accessors = [
        {"bufferView": 0, "componentType": _FLOAT, "count": len(points), "type": "VEC3", **bounds},
        {"bufferView": 1, "componentType": _FLOAT, "count": len(points), "type": "VEC2"},
        {"bufferView": 2, "componentType": _UNSIGNED_INT, "count": mesh.triangles.size, "type": "SCALAR"},
    ]
    document = _document(views, accessors, len(binary))
    with atomic_file(path, force) as scratch:
        scratch.write_bytes(_glb(document, binary))


def _document(views: list[dict[str, Any]], accessors: list[dict[str, Any]], size_bytes: int) -> dict[str, Any]:
    surface = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
    material = {
        "name": "all in focus",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "doubleSided": True,
        "extensions": {"KHR_materials_unlit": {}},
    }
    return {
        "asset": {"version": "2.0", "generator": f"lfstereo {__version__}"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "scene from the rectified left camera, metres"}],
        "meshes": [{"primitives": [surface]}],
        "materials": [material],
        "textures": [{"source": 0, "sampler": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/jpeg"}],
        "samplers": [{"magFilter": _LINEAR, "minFilter": _LINEAR_MIPMAP_LINEAR, "wrapS": _CLAMP, "wrapT": _CLAMP}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": size_bytes}],
    }


def _glb(document: dict[str, Any], binary: bytes) -> bytes:
    """Join the JSON and the binary chunk, each padded to 4 bytes."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), _JSON_CHUNK) + text
    chunks += struct.pack("<II", len(binary), _BINARY_CHUNK) + binary
    return struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks
