"""``lfstereo depth`` as a user runs it: one sweep, two sweeps, and what it refuses."""

from __future__ import annotations

import csv
import json
import re
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from lfstereo.cli.main import main
from lfstereo.depth.pfm import read_pfm
from lfstereo.depth.ply import read_ply
from lfstereo.lightfield.encoding import srgb8, srgb_to_linear
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions, virtual_dslr

SIZE = (120, 160)
FOCAL_PX, BASELINE_M = 400.0, 0.1
FOCI_PX = np.linspace(40, 20, 9)
"""Disparities in focus, which are focal length * baseline / distance: 1 to 2 m."""
SLICE = 0.1
"""Median error in slices, with slices half a px of blur apart and noise of a thousand photons."""
CLEAN = VirtualDslrOptions(lens_samples=24)


def board() -> np.ndarray:
    rng = np.random.default_rng(3)
    dots = cv2.GaussianBlur(rng.random((SIZE[0], SIZE[1] + 80, 3)), (0, 0), 1.0)
    return np.clip(0.5 + 3 * (dots - 0.5), 0.05, 0.95).astype(np.float32)


def write_sweep(folder: Path, picture: np.ndarray, disparity: np.ndarray, focused: np.ndarray = FOCI_PX) -> None:
    stack = virtual_dslr(picture, disparity.astype(np.float32), focused.astype(np.float32), 0.4, CLEAN)
    folder.mkdir()
    for k, slice_ in enumerate(stack.slices):
        cv2.imwrite(str(folder / f"frame{k + 1}.png"), srgb8(slice_)[..., ::-1])


def write_table(path: Path, focused: np.ndarray = FOCI_PX) -> Path:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(
            [f"frame{k + 1}.png", f"{FOCAL_PX * BASELINE_M / d:.6f}"] for k, d in enumerate(focused)
        )
    return path


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slope from 37.5 to 22.5 px of disparity, left to right: slices 1 to 7."""
    folder = tmp_path_factory.mktemp("one")
    write_sweep(folder / "sweep", board()[:, : SIZE[1]], np.tile(np.linspace(37.5, 22.5, SIZE[1]), (SIZE[0], 1)))
    write_table(folder / "focus.csv")
    return folder


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wall at 30 px of disparity before two cameras."""
    folder = tmp_path_factory.mktemp("two")
    wide = board()
    for side, first in (("left", 10), ("right", 40)):
        write_sweep(folder / side, wide[:, first : first + SIZE[1]], np.full(SIZE, 30.0), FOCI_PX[2:7])
    write_table(folder / "focus.csv", FOCI_PX[2:7])
    return folder


@pytest.mark.parametrize("method", ["nayar1992", "hosni2013", "min2014", "moeller2015"])
def test_one_sweep_with_distances(one: Path, tmp_path: Path, method: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [str(one / "sweep"), "--distances", str(one / "focus.csv"), "--focal-px", str(FOCAL_PX)]
    assert main(["depth", *arguments, "--method", method, "-o", str(tmp_path / "out"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    out = tmp_path / "out"
    assert {p.name for p in out.iterdir()} == {
        "slice_index.pfm",
        "confidence.png",
        "depth_colour.png",
        "valid.png",
        "all_in_focus.png",
        "overview.png",
        "depth.tiff",
        "point_cloud.ply",
        "run.toml",
    }
    index, valid = read_pfm(out / "slice_index.pfm")
    true = np.tile(np.linspace(1.0, 7.0, SIZE[1]), (SIZE[0], 1))
    inner = np.zeros(SIZE, bool)
    inner[8:-8, 8:-8] = True
    limit = 3 * SLICE if method == "moeller2015" else SLICE  # its polynomial peaks elsewhere
    assert np.median(np.abs(index - true)[inner & valid]) < limit
    assert valid[inner].mean() > 0.8 and report["valid_share"] == pytest.approx(valid.mean())
    depth = tifffile.imread(out / "depth.tiff")
    metres = FOCAL_PX * BASELINE_M / np.interp(true, np.arange(9), FOCI_PX)
    assert np.median(np.abs(depth / metres - 1)[inner & valid]) < limit * 2.5 / 30  # a slice is 2.5 of 30 px
    cloud = read_ply(out / "point_cloud.ply")
    assert len(cloud.points_m) == report["points"] > 10000
    table = tomllib.loads((out / "run.toml").read_text("utf-8"))
    assert table["stack"]["moved_px"] == [0.0] * 9 and len(table["stack"]["sha256"]) == 9
    assert table["stack"]["distances_m"][0] == pytest.approx(1.0)


def test_one_sweep_by_the_network(one: Path, tmp_path: Path) -> None:
    folders = [tmp_path / "network", tmp_path / "method"]
    assert main(["depth", str(one / "sweep"), "--judge", "network", "--device", "cpu", "-o", str(folders[0])]) == 0
    assert main(["depth", str(one / "sweep"), "-o", str(folders[1])]) == 0
    (by_network, sure), (by_method, valid) = (read_pfm(folder / "slice_index.pfm") for folder in folders)
    assert (sure & valid).mean() > 0.3
    assert np.median(np.abs(by_network - by_method)[sure & valid]) < 0.5  # slices


def test_one_sweep_without_distances(one: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["depth", str(one / "sweep"), "-o", str(tmp_path / "out")]) == 0
    assert "do not tell their focus distances" in capsys.readouterr().out
    assert (tmp_path / "out" / "slice_index_colour.png").is_file()
    assert not (tmp_path / "out" / "depth.tiff").exists()


def test_two_rectified_sweeps(two: Path, tmp_path: Path) -> None:
    arguments = [str(two / "left"), str(two / "right"), "--baseline-m", "0.1", "--focal-px", "400"]
    assert main(["depth", *arguments, "-o", str(tmp_path / "out")]) == 0
    disparity, valid = read_pfm(tmp_path / "out" / "disparity.pfm")
    assert np.median(np.abs(disparity - 30)[valid]) < 0.25  # px
    assert valid[:, 40:-10].mean() > 0.95 and not valid[:, :25].any()
    depth = tifffile.imread(tmp_path / "out" / "depth.tiff")
    assert np.median(depth[valid]) == pytest.approx(FOCAL_PX * BASELINE_M / 30, rel=0.01)
    assert not (tmp_path / "out" / "slice_index.pfm").exists()


def test_two_dense_sweeps_by_the_network(tmp_path: Path) -> None:
    """31 slices, twice as dense as the network's 16; its error here is that of the shipped weights."""
    focused, wide = np.linspace(40, 20, 31), board()
    for side, first in (("left", 10), ("right", 40)):
        write_sweep(tmp_path / side, wide[:, first : first + SIZE[1]], np.full(SIZE, 30.0), focused)
    table = write_table(tmp_path / "focus.csv", focused)
    arguments = [str(tmp_path / "left"), str(tmp_path / "right"), "--distances", str(table), "--match", "network"]
    geometry = ["--baseline-m", "0.1", "--focal-px", "400", "--device", "cpu"]
    assert main(["depth", *arguments, *geometry, "-o", str(tmp_path / "out")]) == 0
    disparity, valid = read_pfm(tmp_path / "out" / "disparity.pfm")
    assert np.median(np.abs(disparity - 30)[valid]) < 2  # px
    assert len(tomllib.loads((tmp_path / "out" / "run.toml").read_text("utf-8"))["sha256"]["weights"]) == 64


def test_two_ordinary_pictures_by_the_network(tmp_path: Path) -> None:
    wide = board()
    for side, first in (("left", 10), ("right", 40)):
        write_sweep(tmp_path / side, wide[:, first : first + SIZE[1]], np.full(SIZE, 30.0), np.array([30.0]))
    arguments = [str(tmp_path / "left"), str(tmp_path / "right"), "--match", "pictures", "--device", "cpu"]
    assert main(["depth", *arguments, "-o", str(tmp_path / "out")]) == 0
    disparity, valid = read_pfm(tmp_path / "out" / "disparity.pfm")
    assert valid.mean() > 0.5 and np.median(np.abs(disparity - 30)[valid]) < 1  # px


def test_two_sweeps_of_toed_in_cameras(two: Path, tmp_path: Path) -> None:
    """The pictures of the wall seen through cameras that are turned towards each other by 2 degrees each."""
    turn = [cv2.Rodrigues(np.array([0.0, np.radians(a), 0.0]))[0] for a in (2.0, -2.0)]  # camera from world
    matrix = np.array([[FOCAL_PX, 0, (SIZE[1] - 1) / 2], [0, FOCAL_PX, (SIZE[0] - 1) / 2], [0, 0, 1]])
    for side, rotation in zip(("left", "right"), turn, strict=True):
        (tmp_path / side).mkdir()
        for path in sorted((two / side).iterdir()):
            turned = matrix @ rotation @ np.linalg.inv(matrix)
            picture = cv2.warpPerspective(cv2.imread(str(path)), turned, SIZE[::-1], flags=cv2.INTER_CUBIC)
            cv2.imwrite(str(tmp_path / side / path.name), picture)
    file = cv2.FileStorage(str(tmp_path / "cameras.yml"), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", SIZE[1])
    file.write("image_height", SIZE[0])
    for n in (1, 2):
        file.write(f"M{n}", matrix)
        file.write(f"D{n}", np.zeros((1, 5)))
    file.write("R", turn[1] @ turn[0].T)
    file.write("T", turn[1] @ np.array([[-BASELINE_M], [0.0], [0.0]]))
    file.release()
    arguments = [str(tmp_path / "left"), str(tmp_path / "right"), "--rig", str(tmp_path / "cameras.yml")]
    ends = ["--near-m", "0.8", "--far-m", "3", "--align", "none"]
    assert main(["depth", *arguments, *ends, "-o", str(tmp_path / "out")]) == 0
    depth, valid = tifffile.imread(tmp_path / "out" / "depth.tiff"), read_pfm(tmp_path / "out" / "disparity.pfm")[1]
    assert valid.mean() > 0.5
    assert np.median(depth[valid]) == pytest.approx(FOCAL_PX * BASELINE_M / 30, rel=0.02)


def refusal(capsys: pytest.CaptureFixture[str], code: int, *words: str | Path) -> str:
    assert main(["depth", *map(str, words)]) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("lfstereo")]
    assert len(lines) == 1
    return lines[0]


def test_refuses_what_one_sweep_cannot_give(one: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ("-o", tmp_path / "out", "--json")
    assert "do not tell their focus distances" in refusal(capsys, 3, one / "sweep", "--metric", *out)
    assert "found one sweep, expected two" in refusal(capsys, 3, one / "sweep", "--rig", "rig.yml", *out)
    (tmp_path / "short").mkdir()
    for name in ("frame1.png", "frame9.png"):
        (tmp_path / "short" / name).symlink_to(one / "sweep" / name)
    assert "found 2 pictures, expected 3 or more" in refusal(capsys, 3, tmp_path / "short", "--align", "none", *out)
    (tmp_path / "same").mkdir()
    for k in range(4):
        (tmp_path / "same" / f"{k}.png").symlink_to(one / "sweep" / "frame5.png")
    assert "of the pixels change in sharpness" in refusal(capsys, 4, tmp_path / "same", *out)
    assert not (tmp_path / "out").exists()


def test_refuses_pairs_that_do_not_fit(
    one: Path, two: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pair, out = (two / "left", two / "right"), ("-o", tmp_path / "out", "--json")
    known = ("--baseline-m", "0.1", "--focal-px", "400", "--distances", two / "focus.csv")
    assert "expected --rig, or --baseline-m" in refusal(capsys, 3, *pair, "--metric", *out)
    assert "network: found no geometry" in refusal(capsys, 3, *pair, "--match", "network", *out)
    line = refusal(capsys, 3, *pair, *known, "--match", "network", "--model", "bdffnet-r16-v1", *out)
    assert "found slices up to 2.50 px of disparity apart, expected at most 0.67 px" in line
    assert "swap the two sweeps" in refusal(capsys, 4, *pair[::-1], *out)
    rig = tmp_path / "cameras.yml"
    assert "give --near-m and --far-m" in refusal(capsys, 3, *pair, "--rig", rig, *out)
    (tmp_path / "small").mkdir()
    for path in sorted(pair[1].iterdir()):
        cv2.imwrite(str(tmp_path / "small" / path.name), cv2.imread(str(path))[:100])
    assert "(rows, columns)" in refusal(capsys, 3, pair[0], tmp_path / "small", *out)


def test_real_sweeps_come_out_right(real_data: Path, tmp_path: Path) -> None:
    """A leaf before the ground, refocused by the camera's own program, whose fused picture comes along."""
    sweep = real_data / "focal" / "lytro48_refocus"
    (tmp_path / "leaf").mkdir()
    for path in sweep.glob("48__refocus_*.jpg"):
        (tmp_path / "leaf" / path.name).symlink_to(path)
    assert main(["depth", str(tmp_path / "leaf"), "--width-px", "540", "-o", str(tmp_path / "out")]) == 0
    index, valid = read_pfm(tmp_path / "out" / "slice_index.pfm")
    assert valid.mean() > 0.9
    assert np.median(index[250:350, 200:300]) < 2 < 6 < np.median(index[100:200, 20:80])  # leaf before the ground
    fused = srgb_to_linear(cv2.imread(str(tmp_path / "out" / "all_in_focus.png"))[..., ::-1].copy())
    theirs = cv2.imread(str(sweep / "aif" / "afocus.png"))[..., ::-1]
    small = cv2.resize(srgb_to_linear(theirs.copy()), fused.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.median(np.abs(fused - small)) < 0.02  # of white


def office_cameras(office: Path, path: Path) -> None:
    """Write the pair's geometry for OpenCV: POV-Ray spans the image plane by ``right`` and ``up``, in cm, y upwards."""
    poses = []
    for n in (1, 2):
        text = (office / f"office_stereo{n}" / f"office_stereo{n}.txt").read_text("utf-8")
        place, ahead, up, right = (
            np.array(re.search(rf"cam_{name}\s*=\s*\[([^\]]*)\]", text)[1].split(), float)
            for name in ("pos", "dir", "up", "right")
        )
        across, down = right / np.linalg.norm(right), -up / np.linalg.norm(up)
        axes = np.stack([across, down, np.cross(down, across)])  # a left-handed world
        focal = axes[2] @ ahead / np.linalg.norm(right) * 1080
        centre = (
            539.5 - focal * (across @ ahead) / (axes[2] @ ahead),
            359.5 - focal * (down @ ahead) / (axes[2] @ ahead),
        )
        poses.append((place, axes, np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])))
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", 1080)
    file.write("image_height", 720)
    for n, (_, _, matrix) in enumerate(poses, 1):
        file.write(f"M{n}", matrix)
        file.write(f"D{n}", np.zeros((1, 5)))
    file.write("R", poses[1][1] @ poses[0][1].T)
    file.write("T", (poses[1][1] @ (poses[0][0] - poses[1][0]) / 100)[:, None])
    file.release()


def test_office_pair(real_data: Path, tmp_path: Path) -> None:
    """Two focus settings of either camera, against matching the pictures of the same scene without any blur."""
    office = real_data / "focal" / "devernay_office_breakfast" / "office"
    office_cameras(office, tmp_path / "cameras.yml")
    for kind, settings in (("sweep", ("near2", "far2")), ("sharp", ("all", "all"))):
        for n, side in ((1, "left"), (2, "right")):
            folder = tmp_path / f"{kind}_{side}"
            folder.mkdir()
            for k, setting in enumerate(settings):
                (folder / f"{k}.png").symlink_to(office / f"office_stereo{n}" / f"office_stereo{n}_{setting}.png")
        ends = ["--rig", str(tmp_path / "cameras.yml"), "--near-m", "1.5", "--far-m", "10", "--width-px", "540"]
        folders = [str(tmp_path / f"{kind}_{side}") for side in ("left", "right")]
        assert main(["depth", *folders, *ends, "-o", str(tmp_path / kind)]) == 0
    maps = [read_pfm(tmp_path / kind / "disparity.pfm") for kind in ("sweep", "sharp")]
    both = maps[0][1] & maps[1][1]
    assert both.mean() > 0.7
    error = np.abs(maps[0][0] - maps[1][0])[both]
    assert np.median(error) < 0.1 and np.mean(error > 1) < 0.05  # px of 540 across
    pictures = [cv2.imread(str(tmp_path / kind / "all_in_focus.png")).astype(float) for kind in ("sweep", "sharp")]
    assert np.median(np.abs(pictures[0] - pictures[1])[both]) < 6  # of 255
