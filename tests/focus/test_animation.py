"""Focal sweeps and orbits."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import imageio.v2 as imageio
import numpy as np
import pytest

from lfstereo.errors import ConfigError, MissingExtraError, OutputError
from lfstereo.focus.animation import AnimationOptions, orbit_frames, sweep_frames, write_animation
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField


def read_frames(path: Path) -> list[np.ndarray]:
    if path.suffix == ".gif":
        return list(imageio.mimread(path))
    video, frames = cv2.VideoCapture(str(path)), []
    while (read := video.read())[0]:
        frames.append(read[1][..., ::-1])
    video.release()
    return frames


@pytest.fixture
def field() -> LightField:
    y, x = np.mgrid[:21, :31].astype(np.float32)
    views = [[0.5 + 0.4 * np.sin(0.4 * (x + s - 2)) * np.cos(0.3 * (y + t - 2)) for s in range(5)] for t in range(5)]
    return LightField(np.repeat(np.float32(views)[..., None], 3, axis=-1), None, None, "", "test")


def test_a_sweep_goes_there_and_back(field: LightField) -> None:
    frames = list(sweep_frames(field, 1.0, -1.0, AnimationOptions(frames=8)))
    assert len(frames) == 8 and frames[0].shape == (21, 31, 3)
    for k in range(1, 8):
        np.testing.assert_array_equal(frames[k], frames[8 - k])
    ends = srgb8(refocus(field, [1.0, -1.0], RefocusOptions()))
    np.testing.assert_array_equal(frames[0], ends[0])
    np.testing.assert_array_equal(frames[4], ends[1])


def test_an_orbit_holds_its_slope_still(field: LightField) -> None:
    still = np.stack(list(orbit_frames(field, 1.0, AnimationOptions("orbit", frames=6))))[:, 4:-4, 4:-4].astype(float)
    moving = np.stack(list(orbit_frames(field, 0.0, AnimationOptions("orbit", frames=6))))[:, 4:-4, 4:-4].astype(float)
    assert still.std(axis=0).max() < 6  # codes of 8 bits
    assert moving.std(axis=0).max() > 30


@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
def test_writes_what_others_read(name: str, field: LightField, tmp_path: Path) -> None:
    options = AnimationOptions(frames=6, width_px=32)
    frames = list(sweep_frames(field, 1.0, -1.0, options))
    assert write_animation(tmp_path / name, iter(frames), options.fps) == 6
    found = read_frames(tmp_path / name)
    assert len(found) == 6 and found[0].shape[1] == 32
    assert np.abs(found[3][:20, :, :3].astype(int) - frames[3][:20]).mean() < 16
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]
    with pytest.raises(OutputError, match="exists already"):
        write_animation(tmp_path / name, iter(frames), options.fps)


def test_nothing_is_left_of_an_animation_that_failed(field: LightField, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="frames = 1"):
        write_animation(tmp_path / "a.gif", sweep_frames(field, 1.0, 0.0, AnimationOptions(frames=1)), 10.0)
    assert not list(tmp_path.iterdir())


def test_refuses_other_suffixes(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"expected \.gif or \.mp4"):
        write_animation(tmp_path / "a.avi", iter([]), 10.0)


def test_says_what_a_video_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match="pip install imageio-ffmpeg"):
        write_animation(tmp_path / "a.mp4", iter([]), 10.0)


@pytest.mark.parametrize(
    "options", [AnimationOptions(fps=0.0), AnimationOptions(width_px=-1), AnimationOptions("orbit", radius_views=-1.0)]
)
def test_refuses_impossible_options(options: AnimationOptions, field: LightField) -> None:
    with pytest.raises(ConfigError, match=r"(fps|width_px|radius_views) = "):
        next(orbit_frames(field, 0.0, options))
