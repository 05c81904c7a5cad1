"""Dual focal stack data sets: the published layout written, resumed, split, and read back."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.depth.pfm import write_pfm
from lfstereo.errors import ConfigError, InputError, ShapeError
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stack_dataset import list_dual_stacks, open_dataset, read_dual_stack, write_dual_stack
from lfstereo.simulate.stereo_scenes import SceneFiles, StereoScene, find_scenes, read_scene
from lfstereo.simulate.synthesis import SplitOptions, frames_for_tests, parts_of, photograph, synthesize
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions

HEIGHT, WIDTH = 16, 24
FEW = PhotographOptions(slices=3, aperture_ratio=0.2)
QUICK = VirtualDslrOptions(lens_samples=3, noise=False, threads=1)
ONE_CODE = 0.005  # linear light: half an 8-bit step where the sRGB curve is steepest
HALF_STEP_PX = 50 / 255


def flying_things(root: Path, largest: dict[str, float]) -> Path:
    """Write frames ``TRAIN/A/0000/0006`` and so on, each with a square of the given disparity."""
    rng = np.random.default_rng(0)
    for frame, top in largest.items():
        for side in ("left", "right"):
            picture = root / "frames_cleanpass" / frame.replace("*", side)
            picture.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(f"{picture}.png", rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8))
            truth = np.full((HEIGHT, WIDTH), 2, np.float32)
            truth[4:8, 4:9] = top
            path = root / "disparity" / f"{frame.replace('*', side)}.pfm"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_pfm(path, truth)
    return root


def plain_scene(name: str = "wall", d: float = 12.3) -> StereoScene:
    picture = np.random.default_rng(5).random((HEIGHT, WIDTH, 3), dtype=np.float32)
    disparity = np.full((HEIGHT, WIDTH), d, np.float32)
    known = np.ones((HEIGHT, WIDTH), bool)
    known[0] = False
    return StereoScene(name, picture, picture[:, ::-1], disparity, known, disparity + 1)


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    open_dataset(tmp_path, FEW, QUICK)
    write_dual_stack(tmp_path, "train", photograph(plain_scene("my_wall_2"), FEW, QUICK), noisy=False)
    return tmp_path


def test_the_published_layout(dataset: Path) -> None:
    stacks = dataset / "binocular_focal_stack_clean" / "train"
    slices = sorted(f"my_wall_2_{k:02d}_{side}_image.png" for k in range(3) for side in "LR")
    assert sorted(p.name for p in stacks.iterdir()) == slices
    pairs = {p.name for p in (dataset / "color_depth_pair" / "train").iterdir()}
    assert pairs >= {f"my_wall_2_{kind}_{side}.png" for kind in ("color", "depth") for side in "LR"}
    grey = cv2.imread(str(dataset / "color_depth_pair" / "train" / "my_wall_2_depth_L.png"), cv2.IMREAD_UNCHANGED)
    assert grey.dtype == np.uint8 and grey.shape == (HEIGHT, WIDTH)
    assert (grey == round(12.3 * 255 / 100)).all()


def test_what_is_written_is_read_back(dataset: Path) -> None:
    wanted = photograph(plain_scene("my_wall_2"), FEW, QUICK)
    assert list_dual_stacks(dataset, "train", noisy=False) == ["my_wall_2"]
    found = read_dual_stack(dataset, "train", "my_wall_2", noisy=False)
    for a, b in ((found.left, wanted.left), (found.right, wanted.right)):
        np.testing.assert_allclose(a.slices, b.slices, atol=ONE_CODE)
        np.testing.assert_array_equal(a.disparities_px, b.disparities_px)
        assert a.aperture_ratio == 0.2
    np.testing.assert_allclose(found.sharp, wanted.sharp, atol=ONE_CODE)
    np.testing.assert_array_equal(found.disparity[1:], wanted.disparity[1:])
    np.testing.assert_array_equal(found.known, wanted.known)
    np.testing.assert_allclose(found.right_disparity, wanted.right_disparity, atol=HALF_STEP_PX)


def test_a_foreign_data_set_needs_to_be_told_its_focus(dataset: Path) -> None:
    (dataset / "binocular_focal_stack_clean" / "stacks.toml").unlink()
    (dataset / "color_depth_pair" / "train" / "my_wall_2_disparity_L.pfm").unlink()
    with pytest.raises(InputError, match=r"stacks\.toml: not there; say at which disparities"):
        read_dual_stack(dataset, "train", "my_wall_2", noisy=False)
    near, far = (read_dual_stack(dataset, "train", "my_wall_2", False, FEW, far_first=flip) for flip in (False, True))
    np.testing.assert_array_equal(near.left.slices, far.left.slices[::-1])
    np.testing.assert_allclose(near.disparity, 12.3, atol=HALF_STEP_PX)
    assert near.known.all()


def test_flying_things_are_split_limited_and_resumed(tmp_path: Path) -> None:
    frames = {f"TRAIN/A/000{i}/*/0006": d for i, d in enumerate((30.0, 99.0, 100.0, 150.0))}
    root = flying_things(tmp_path / "things", {**frames, "TEST/B/0000/*/0007": 50.0})
    words = ["synthesize", str(root), "-o", str(tmp_path / "out"), "--slices", "2", "--lens-samples", "2", "--json"]
    assert main(words) == 0
    assert {p.name[:11] for p in (tmp_path / "out").glob("binocular_focal_stack_noise/test/*")} == {"B-0000-0007"}
    written = tmp_path / "out" / "binocular_focal_stack_noise" / "train"
    assert {p.name[:11] for p in written.iterdir()} == {"A-0000-0006", "A-0001-0006"}
    (lost := written / "A-0001-0006_01_R_image.png").unlink()
    before = {p: p.stat().st_mtime_ns for p in written.glob("A-0000*")}
    assert main(words) == 0
    assert lost.is_file()
    assert {p: p.stat().st_mtime_ns for p in written.glob("A-0000*")} == before


def test_a_resumed_run_says_what_was_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = flying_things(tmp_path / "things", {"TRAIN/A/0000/*/0006": 30.0, "TRAIN/A/0000/*/0007": 120.0})
    words = ["synthesize", str(root), "-o", str(tmp_path / "out"), "--slices", "2", "--lens-samples", "2"]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["too_near"] == ["train/A-0000-0007"]
    assert main(words) == 0
    assert "0 scenes of 2 slices per view written, 1 were there, 1 left out as too near" in capsys.readouterr().out
    assert main([*words, "--aperture-ratio", "0.3"]) == 3
    assert "was made with other options; give the same ones" in capsys.readouterr().err
    assert main([*words, "--no-noise"]) == 0  # beside the noisy stacks
    assert (tmp_path / "out" / "binocular_focal_stack_clean" / "stacks.toml").is_file()


def test_limits_of_the_split(tmp_path: Path) -> None:
    root = flying_things(tmp_path / "things", {f"TRAIN/A/0000/*/000{i}": 30.0 for i in range(5)})
    files = [
        SceneFiles(
            f"s{i}",
            root / f"frames_cleanpass/TRAIN/A/0000/left/000{i}.png",
            root / f"frames_cleanpass/TRAIN/A/0000/right/000{i}.png",
            root / f"disparity/TRAIN/A/0000/left/000{i}.pfm",
        )
        for i in range(5)
    ]
    steps: list[tuple[int, int]] = []
    found = synthesize(
        tmp_path / "out", files, FEW, QUICK, SplitOptions(3, 1), lambda done, total: steps.append((done, total))
    )
    assert sorted(label.split("/")[0] for label in found.written) == ["test", "train", "train", "train"]
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]
    again = synthesize(tmp_path / "out", files, FEW, QUICK, SplitOptions(3, 1))
    assert again.kept == found.written and not again.written


def test_the_papers_split() -> None:
    files = [SceneFiles(str(i), Path(), Path(), Path()) for i in range(910)]
    assert parts_of(files, SplitOptions()).count("test") == 160


def test_frames_for_tests_are_those_that_a_data_set_would_hold(tmp_path: Path) -> None:
    frames = {f"TEST/B/0000/*/000{i}": d for i, d in enumerate((30.0, 120.0, 40.0, 50.0))}
    files = find_scenes(flying_things(tmp_path / "things", {**frames, "TRAIN/A/0000/*/0006": 20.0}))
    chosen = [f.name for f in frames_for_tests(files, 100, SplitOptions(), 0)]
    assert sorted(chosen) == ["B-0000-0000", "B-0000-0002", "B-0000-0003"]
    split = SplitOptions(train=0, test=2)
    written = synthesize(tmp_path / "out", files, FEW, QUICK, split).written
    assert [f"test/{f.name}" for f in frames_for_tests(files, 100, split, 0)] == list(written)
    plain = [SceneFiles("own", Path(), Path(), Path())]
    assert frames_for_tests(plain, 100, SplitOptions(), 0) == plain


def test_a_pair_of_your_own(tmp_path: Path) -> None:
    root = flying_things(tmp_path / "things", {"TRAIN/A/0000/*/0006": 30.0})
    left, right = (root / f"frames_cleanpass/TRAIN/A/0000/{side}/0006.png" for side in ("left", "right"))
    truth = tmp_path / "own.png"
    cv2.imwrite(str(truth), np.full((HEIGHT, WIDTH), 80, np.uint8))
    words = ["synthesize", "--pair", str(left), str(right), str(truth), "--disparity-scale", "4", "--slices", "2"]
    assert main([*words, "-o", str(tmp_path / "out"), "--lens-samples", "2"]) == 0
    assert (read_dual_stack(tmp_path / "out", "train", "0006", noisy=True).disparity == 20).all()
    assert read_scene(SceneFiles("x", left, right, truth, scale=4.0)).disparity[0, 0] == 20


@pytest.mark.parametrize("words", [[], ["--pair", "a.png", "b.png", "c.pfm", "--pair", "a.png", "b.png", "c.pfm"]])
def test_bad_requests_are_one_line(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["synthesize", "-o", str(tmp_path / "out"), *words]) == 3
    error = capsys.readouterr().err
    assert ("found more than once" if words else "give folders of scenes or --pair") in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_scenes_that_do_not_fit_the_layout(tmp_path: Path) -> None:
    sample = photograph(plain_scene("a/b"), FEW, QUICK)
    with pytest.raises(InputError, match="scene name 'a/b': expected letters"):
        write_dual_stack(tmp_path, "train", sample, noisy=False)
    far = photograph(plain_scene("far", 99.5), FEW, QUICK)
    with pytest.raises(InputError, match=r"far: disparities up to 100.5 px, the layout holds 0 to 100 px"):
        write_dual_stack(tmp_path, "train", far, noisy=False)
    with pytest.raises(ConfigError, match="expected 1 slice or more"):
        open_dataset(tmp_path, PhotographOptions(slices=0), QUICK)


def test_damaged_data_sets(dataset: Path) -> None:
    stacks, pairs = dataset / "binocular_focal_stack_clean" / "train", dataset / "color_depth_pair" / "train"
    with pytest.raises(InputError, match=r"test: holds no \[scene\]_\[slice\]_\[L/R\]_image\.png"):
        list_dual_stacks(dataset, "test", noisy=False)
    depth = (pairs / "my_wall_2_depth_R.png").read_bytes()
    (pairs / "my_wall_2_depth_R.png").write_bytes(b"")
    with pytest.raises(InputError, match=r"my_wall_2_depth_R\.png: not there or no picture"):
        read_dual_stack(dataset, "train", "my_wall_2", noisy=False)
    (pairs / "my_wall_2_depth_R.png").write_bytes(depth)
    whole = (stacks / "my_wall_2_02_R_image.png").read_bytes()
    (stacks / "my_wall_2_02_R_image.png").unlink()
    with pytest.raises(ShapeError, match="expected one size and as many slices"):
        read_dual_stack(dataset, "train", "my_wall_2", noisy=False)
    (stacks / "my_wall_2_01_L_image.png").unlink()
    with pytest.raises(InputError, match=r"slices \[0, 2\] of my_wall_2 L, expected a row without gaps"):
        read_dual_stack(dataset, "train", "my_wall_2", noisy=False)
    cv2.imwrite(str(stacks / "my_wall_2_01_L_image.png"), np.zeros((3, 3, 3), np.uint8))
    (stacks / "my_wall_2_02_R_image.png").write_bytes(whole)
    with pytest.raises(ShapeError, match="my_wall_2 L differ in size"):
        read_dual_stack(dataset, "train", "my_wall_2", noisy=False)
