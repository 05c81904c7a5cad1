"""Shared by all tests: where real data lies, if anywhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from lfstereo.container import Capture, FrameMetadata
from lfstereo.container.mosaic_image import read_camera_profile

# The same examples every time, however slow the machine.
settings.register_profile(
    "suite",
    max_examples=40,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("suite")
_NETWORK_EVENTS = {"socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.sendto", "urllib.Request"}
_offline = False


def _refuse_network(event: str, arguments: tuple[object, ...]) -> None:
    if _offline and event in _NETWORK_EVENTS:
        raise AssertionError(f"{event} {arguments[1:]}: lfstereo must not use the network")


sys.addaudithook(_refuse_network)


@pytest.fixture
def offline() -> Iterator[None]:
    """A test in which no connection may be opened and no name looked up, however deep inside a library."""
    global _offline
    _offline = True
    yield
    _offline = False


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real photographs and references; the test is skipped where none is named."""
    named = os.environ.get("LFSTEREO_DATA", "")
    if not named:
        pytest.skip("LFSTEREO_DATA names no folder of real captures (see tests/DATA.md)")
    folder = Path(named)
    assert folder.is_dir(), f"LFSTEREO_DATA={named} is no folder"
    return folder


@pytest.fixture(autouse=True, scope="session")
def home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder for imported white images and cached results, so that tests leave the user's alone."""
    folder = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LFSTEREO_HOME", str(folder))
        yield folder


@dataclass(frozen=True)
class LensletFrame:
    """A synthetic raw frame and the lattice it was drawn with."""

    capture: Capture
    origin: np.ndarray
    row: np.ndarray
    diagonal: np.ndarray

    def lattice_error(self, points: np.ndarray) -> np.ndarray:
        """Return ``(N, 2)`` px from the nearest true micro-image centre to each point."""
        matrix = np.stack([self.row, self.diagonal], axis=1)
        index = np.round((points.reshape(-1, 2) - self.origin) @ np.linalg.inv(matrix).T)
        return points.reshape(-1, 2) - self.origin - index @ matrix.T


Scene = Callable[[np.ndarray, np.ndarray], np.ndarray]


@pytest.fixture(scope="session")
def draw_frame() -> Callable[..., LensletFrame]:
    """Draw a raw frame: round micro-images on a hexagonal lattice, Bayer filters, noise, whole digital numbers."""

    def draw(
        shape: tuple[int, int] = (400, 440),
        pitch: float = 14.3,
        rotation: float = 0.002,
        origin: tuple[float, float] = (6.2, 9.7),
        scene: Scene | None = None,
        parallax: float = 0.0,
        shading: float = 0.0,
        noise: float = 1.0,
        peak: float = 700.0,
        colour: tuple[float, float, float] = (0.776, 1.0, 0.734),
        bayer: str = "grbg",
        **metadata: Any,
    ) -> LensletFrame:
        """``scene(x, y)`` is read at the lenslet's centre plus ``parallax`` times the offset inside the micro-image."""
        cos, sin = np.cos(rotation), np.sin(rotation)
        turn = np.array([[cos, -sin], [sin, cos]])
        row, diagonal = turn @ [pitch, 0.0], turn @ [pitch / 2, pitch * np.sqrt(3) / 2]
        matrix = np.stack([row, diagonal], axis=1)
        y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
        index = np.floor(np.stack([x - origin[0], y - origin[1]], axis=-1) @ np.linalg.inv(matrix).T)
        light = np.zeros(shape)
        for corner in ((0, 0), (1, 0), (0, 1), (1, 1)):
            centre = np.asarray(origin) + (index + corner) @ matrix.T
            dx, dy = x - centre[..., 0], y - centre[..., 1]
            radius = np.hypot(dx, dy)
            part = 1 / (1 + np.exp((radius - 0.46 * pitch) / 0.3)) * (1 - 0.1 * (2 * radius / pitch) ** 2)
            if shading:
                towards = (dx * (centre[..., 0] - shape[1] / 2) + dy * (centre[..., 1] - shape[0] / 2)) / (shape[1] / 2)
                part = part * (1 + shading * towards)
            if scene is not None:
                part = part * scene(centre[..., 0] + parallax * dx, centre[..., 1] + parallax * dy)
            light += np.maximum(part, 0)
        sites = {"r": colour[0], "g": colour[1], "b": colour[2]}
        for k, name in enumerate(bayer):
            light[k // 2 :: 2, k % 2 :: 2] *= sites[name]
        numbers = 64 + peak * light + np.random.default_rng(5).normal(0, noise, shape)
        mosaic = np.clip(np.round(numbers), 0, 1023).astype(np.uint16)
        described = frame_metadata(shape, bayer=bayer, is_white_image=scene is None, **metadata)
        return LensletFrame(Capture(mosaic, described, "drawn frame"), np.asarray(origin), row, diagonal)

    return draw


def frame_metadata(shape: tuple[int, int], **changes: Any) -> FrameMetadata:
    """Return Illum metadata with neutral colours for a frame of any size."""
    neutral = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    values: dict[str, Any] = {
        "serial": "SIM1",
        "width": shape[1],
        "height": shape[0],
        "black": (64.0,) * 4,
        "white": (1023.0,) * 4,
        "white_balance": (1 / 0.776, 1.0, 1.0, 1 / 0.734),
        "ccm": neutral,
        "exposure_bias_ev": 0.0,
        "is_dark_frame": False,
    }
    return replace(read_camera_profile("lytro-illum"), **(values | changes))
