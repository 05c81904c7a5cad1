"""Surfaces from depth: torn at outlines, in metres, and readable as glTF."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lfstereo.depth.glb import write_glb
from lfstereo.depth.mesh import Mesh, MeshOptions, mesh_from_depth
from lfstereo.depth.triangulate import DepthMap
from lfstereo.errors import ConfigError, OutputError, ShapeError

FOCAL_PX = 10.0
PRINCIPAL_PX = (2.0, 1.0)
JPEG_CODES = 6
"""Largest difference of a plain colour after JPEG."""


def wall(rows: int = 4, columns: int = 6, depth_m: float = 2.0) -> DepthMap:
    return DepthMap(np.full((rows, columns), depth_m, np.float32), np.ones((rows, columns), bool))


def read_glb(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray], bytes]:
    """Read by the specification alone: document, vertex arrays and the texture's bytes."""
    content = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    assert size % 4 == 0
    document = json.loads(content[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", content, 20 + size)
    assert kind == b"BIN\0"
    binary = content[28 + size :]
    assert len(binary) == binary_size == document["buffers"][0]["byteLength"]

    def block(view: int) -> bytes:
        where = document["bufferViews"][view]
        return binary[where["byteOffset"] : where["byteOffset"] + where["byteLength"]]

    arrays = {}
    for name, accessor in (("points", 0), ("places", 1), ("indices", 2)):
        told = document["accessors"][accessor]
        kind = {5126: "<f4", 5125: "<u4"}[told["componentType"]]
        width = {"VEC3": 3, "VEC2": 2, "SCALAR": 1}[told["type"]]
        arrays[name] = np.frombuffer(block(told["bufferView"]), kind).reshape(told["count"], width)
    return document, arrays, block(document["images"][0]["bufferView"])


def test_points_lie_where_the_pinhole_puts_them() -> None:
    mesh = mesh_from_depth(wall(), FOCAL_PX, PRINCIPAL_PX)
    assert len(mesh.points_m) == 24
    assert len(mesh.triangles) == 2 * 3 * 5
    # Pixel (5, 3): x = (5 - 2) 2 m / 10, y = (3 - 1) 2 m / 10.
    np.testing.assert_allclose(mesh.points_m[-1], [0.6, 0.4, 2.0], rtol=1e-6)
    np.testing.assert_allclose(mesh.places[-1], [5.5 / 6, 3.5 / 4], rtol=1e-6)


def test_triangles_face_the_camera() -> None:
    depth = wall()
    depth.depth_m[:] += np.linspace(0, 0.02, 24, dtype=np.float32).reshape(4, 6)
    mesh = mesh_from_depth(depth, FOCAL_PX, PRINCIPAL_PX)
    a, b, c = (mesh.points_m[mesh.triangles[:, k]] for k in range(3))
    # z points away from the camera and y down: counter-clockwise to the eye means a normal along -z.
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()


def test_surface_is_torn_at_an_outline() -> None:
    depth = wall()
    depth.depth_m[:, 3:] = 3.0
    mesh = mesh_from_depth(depth, FOCAL_PX, PRINCIPAL_PX)
    z = mesh.points_m[mesh.triangles][..., 2]
    assert np.ptp(z, axis=1).max() == 0.0
    assert len(mesh.triangles) == 2 * 3 * 4
    joined = mesh_from_depth(depth, FOCAL_PX, PRINCIPAL_PX, MeshOptions(edge_step=0.6))
    assert len(joined.triangles) == 2 * 3 * 5


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_one_far_corner_leaves_the_other_triangle(corner: tuple[int, int]) -> None:
    depth = wall(2, 2)
    depth.depth_m[corner] = 9.0
    mesh = mesh_from_depth(depth, FOCAL_PX, PRINCIPAL_PX)
    assert len(mesh.triangles) == 1
    assert (mesh.points_m[:, 2] == 2.0).all()


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_unknown_pixels_are_no_corners(corner: tuple[int, int]) -> None:
    depth = wall(2, 2)
    depth.valid[corner] = False
    assert len(mesh_from_depth(depth, FOCAL_PX, PRINCIPAL_PX).triangles) == 1


def test_refuses_a_step_of_nothing() -> None:
    with pytest.raises(ConfigError, match="edge_step = 0"):
        mesh_from_depth(wall(), FOCAL_PX, PRINCIPAL_PX, MeshOptions(edge_step=0.0))


def test_glb_holds_the_mesh_in_gltf_axes(tmp_path: Path) -> None:
    mesh = mesh_from_depth(wall(), FOCAL_PX, PRINCIPAL_PX)
    texture = np.full((4, 6, 3), (200, 100, 50), np.uint8)
    write_glb(tmp_path / "m.glb", mesh, texture)
    document, arrays, picture = read_glb(tmp_path / "m.glb")
    np.testing.assert_allclose(arrays["points"], mesh.points_m * [1, -1, -1])
    np.testing.assert_array_equal(arrays["places"], mesh.places)
    np.testing.assert_array_equal(arrays["indices"].reshape(-1, 3), mesh.triangles)
    np.testing.assert_allclose(document["accessors"][0]["max"], arrays["points"].max(axis=0))
    np.testing.assert_allclose(document["accessors"][0]["min"], arrays["points"].min(axis=0))
    decoded = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert np.abs(decoded.astype(int) - texture).max() <= JPEG_CODES


def test_glb_is_refused_where_it_cannot_be(tmp_path: Path) -> None:
    mesh = mesh_from_depth(wall(), FOCAL_PX, PRINCIPAL_PX)
    texture = np.zeros((4, 6, 3), np.uint8)
    with pytest.raises(ShapeError, match="texture"):
        write_glb(tmp_path / "m.glb", mesh, texture[..., 0])
    empty = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 2), np.float32), np.zeros((0, 3), np.uint32))
    with pytest.raises(ShapeError, match="without triangles"):
        write_glb(tmp_path / "m.glb", empty, texture)
    write_glb(tmp_path / "m.glb", mesh, texture)
    with pytest.raises(OutputError, match="exists already"):
        write_glb(tmp_path / "m.glb", mesh, texture)
