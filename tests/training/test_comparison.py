"""``lfstereo evaluate``: scenes found and photographed, every method judged, tables written."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from lfstereo.cli.main import main
from lfstereo.depth.disparity import DisparityMap
from lfstereo.depth.pfm import write_pfm
from lfstereo.errors import ConfigError
from lfstereo.focus.stack import FocalStack
from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.network.card import ModelCard, Training
from lfstereo.network.estimate import Network
from lfstereo.simulate.photograph import PhotographOptions, focus_disparities, photograph_pair
from lfstereo.simulate.stack_dataset import DualStack, read_dual_stack
from lfstereo.simulate.stereo_scenes import StereoScene
from lfstereo.simulate.synthesis import photograph
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions
from lfstereo.training import comparison
from lfstereo.training import rows as row_scores
from lfstereo.training.comparison import BASELINES, EDOF, NETWORKS, WLS_ON_EDOF, compare
from lfstereo.training.rows import Row, summarise

HEIGHT, WIDTH = 64, 128
QUICK = VirtualDslrOptions(lens_samples=4, noise=False)


def scene() -> StereoScene:
    """A textured wall at 8 px and a textured square at 20 px, exact in both views."""
    rng = np.random.default_rng(1)
    wall, square = (cv2.GaussianBlur(rng.random((HEIGHT, 256, 3), dtype=np.float32), (0, 0), 0.8) for _ in range(2))
    wall = (wall - 0.3) * 2
    disparity, right_disparity = (np.full((HEIGHT, WIDTH), 8, np.float32) for _ in range(2))
    left, right = wall[:, :WIDTH].clip(0.01, 1), wall[:, 8 : 8 + WIDTH].clip(0.01, 1)
    left[20:44, 60:90] = square[20:44, :30]
    right[20:44, 40:70] = square[20:44, :30]
    disparity[20:44, 60:90] = right_disparity[20:44, 40:70] = 20
    return StereoScene("square", left, right, disparity, np.ones((HEIGHT, WIDTH), bool), right_disparity)


@pytest.fixture(scope="module")
def case() -> DualStack:
    return photograph(scene(), PhotographOptions(aperture_ratio=0.4, near_px=32), QUICK)


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(1)
    module = BdffNet(Architecture(focus_width=4, edof_width=4, tail_width=4, stereo_width=16)).eval()
    return Network(module, ModelCard("tiny", 1, "BSD-3-Clause", "", (), (), module.architecture, Training()), "cpu")


def write_middlebury(folder: Path, suffix: str = "2014") -> Path:
    pair = scene()
    place = folder / "Square"
    place.mkdir(parents=True)
    names = {"2014": ("im0", "im1"), "2005": ("view1", "view5"), "2003": ("im2", "im6")}[suffix]
    for name, picture in zip(names, (pair.left, pair.right), strict=True):
        coded = np.rint(255 * np.where(picture <= 0.0031308, 12.92 * picture, 1.055 * picture ** (1 / 2.4) - 0.055))
        cv2.imwrite(str(place / f"{name}.png"), coded[..., ::-1].astype(np.uint8))
    if suffix == "2014":
        write_pfm(place / "disp0GT.pfm", pair.disparity)
        (place / "calib.txt").write_text("doffs=0\n", "utf-8")
    else:
        scale, stem = (3, "disp1") if suffix == "2005" else (8, "disp2")
        cv2.imwrite(str(place / f"{stem}.png"), (pair.disparity * scale).astype(np.uint8))
    return folder


def test_every_method_is_judged(case: DualStack, network: Network) -> None:
    rows = {row.method: row for row in compare(case, network)}
    assert set(rows) == {*NETWORKS, EDOF, WLS_ON_EDOF, *BASELINES}
    assert rows["SGBM+WLS filled"].mae_px < 1.0  # px; an easy scene
    assert rows["depth from focus"].mae_px < 3.0
    assert rows["SGBM"].density < 100 == rows["SGBM+WLS filled"].density == rows["BDfF-Net"].density
    assert rows["BDfF-Net"].seconds >= rows["Stereo-Net"].seconds > 0
    assert rows[EDOF].mae_px is None and rows[EDOF].psnr_db > 5
    assert rows["BDfF-Net"].mae_norm == pytest.approx(rows["BDfF-Net"].mae_px / 100)


def test_a_pair_without_any_match_is_reported_as_unanswered(case: DualStack, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(left: np.ndarray, right: np.ndarray, d_max: float) -> DisparityMap:
        return DisparityMap(np.zeros(left.shape[:2], np.float32), np.zeros(left.shape[:2], bool), left)

    monkeypatch.setattr(comparison, "sgbm", nothing)
    monkeypatch.setattr(row_scores, "sgbm_wls", nothing)
    rows = {row.method: row for row in compare(case, None)}
    for method in BASELINES[:2]:
        assert rows[method].density == 0 and rows[method].mae_px is rows[method].bad_2 is None
    assert rows[BASELINES[2]].density == 100


def test_the_network_rows_are_the_maps_of_the_network(
    case: DualStack, network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A network that answers 8 px everywhere is off by 12 px on the square alone."""

    def fixed(left: torch.Tensor, right: torch.Tensor, range_px: tuple[float, float]) -> object:
        assert range_px == (0.0, 32.0)
        found = forward(left, right, range_px)
        found.fused.fill_(0.08)
        return found

    forward = network.module.forward
    monkeypatch.setattr(network.module, "forward", fixed)
    row = next(row for row in compare(case, network) if row.method == "BDfF-Net")
    share = 24 * 30 / (HEIGHT * WIDTH)
    assert row.mae_px == pytest.approx(12 * share, rel=1e-4)
    assert row.bad_4 == pytest.approx(100 * share, rel=1e-4)


def test_summary_is_the_mean_over_scenes() -> None:
    def row(scene: str, method: str, value: float, psnr: float | None = None) -> Row:
        return Row(scene, method, value / 100, value, 1.0, 2.0, 3.0, 4.0, 100.0, 0.5, psnr)

    edof = Row("a", EDOF, None, None, None, None, None, None, None, 1.0, 30.0)
    found = summarise([row("a", "x", 1.0), edof, row("b", "x", 4.0)])
    assert [(r.scene, r.method, r.mae_px, r.psnr_db) for r in found] == [
        ("all", "x", 2.5, None),
        ("all", EDOF, None, 30),
    ]


@pytest.mark.parametrize("kind", ["2014", "2005", "2003"])
def test_middlebury_folders_from_the_command_line(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "errors.csv"
    words = ["evaluate", str(write_middlebury(tmp_path / "sets", kind)), "--no-network", "--lens-samples", "4"]
    assert main([*words, "-o", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["scene"] for row in found["scenes"]} == {"Square"}
    by_method = {row["method"]: row for row in found["all"]}
    assert set(by_method) == set(BASELINES)
    assert by_method["SGBM+WLS filled"]["mae_px"] < 1.0
    with out.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["scene"] for row in rows] == ["Square"] * 3 + ["all"] * 3
    assert float(rows[1]["mae_px"]) == pytest.approx(by_method["SGBM+WLS filled"]["mae_px"], abs=1e-5)
    assert main([*words, "-o", str(out)]) == 3
    assert "exists already" in capsys.readouterr().err


def test_held_out_scenes_as_a_table(
    capsys: pytest.CaptureFixture[str], network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lfstereo.network.estimate.load_network", lambda name, device: network)
    monkeypatch.setattr(comparison, "texture_bank", lambda seed, count: np.full((2, 256, 256, 3), 0.5, np.float32))
    assert main(["evaluate", "--synthetic", "2", "--size", "64x96", "--aperture-ratio", "0.2"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("model: tiny-v1")
    assert "synthetic-000" in printed and "mean of 2 scenes" in printed
    for method in (*NETWORKS, EDOF, *BASELINES):
        assert printed.count(f"  {method}  ") == 3


def test_generated_data_set_is_written_resumed_and_evaluated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bank = np.random.default_rng(1).random((2, 256, 256, 3), dtype=np.float32)
    monkeypatch.setattr("lfstereo.training.generated_dataset.texture_bank", lambda seed, count: bank)
    words = ["synthesize", "--generated", "64x96", "--train", "1", "--test", "1", "-o", str(tmp_path)]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["written"] == [
        "train/generated-train-00000",
        "test/generated-test-00000",
    ]
    assert main(words) == 0
    assert "0 scenes of 16 slices per view written, 2 were there" in capsys.readouterr().out
    read = read_dual_stack(tmp_path, "test", "generated-test-00000", noisy=True)
    assert read.left.slices.shape == (16, 64, 96, 3) and 0 <= read.disparity.min() <= read.disparity.max() <= 100
    assert main(["evaluate", str(tmp_path), "--no-network", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["scene"] for row in found["scenes"]} == {"generated-test-00000"}
    assert main([*words, "--slices", "8"]) == 3
    assert "expected 16 slices from 100 to 0 px with noise" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "nothing to evaluate on"),
        (["--synthetic", "-1"], "nothing to evaluate on"),
        (["--synthetic", "1", "--size", "540"], "--size 540: expected HEIGHTxWIDTH"),
        (["--synthetic", "1", "--size", "32x960"], "64x64 or more"),
        (["nowhere"], "nowhere: holds no stereo scene"),
    ],
)
def test_bad_requests_are_one_line(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "--no-network", *words]) == 3
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_stacks_of_both_views_share_focus_but_not_noise() -> None:
    pair = scene()
    left, right = photograph_pair(pair, PhotographOptions(slices=3), VirtualDslrOptions(lens_samples=4))
    assert isinstance(left, FocalStack)
    np.testing.assert_array_equal(left.disparities_px, right.disparities_px)
    clean = photograph_pair(pair, PhotographOptions(slices=3), QUICK)
    noise = [a.slices - b.slices for a, b in zip((left, right), clean, strict=True)]
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.1


def test_a_scene_nearer_than_the_nearest_slice() -> None:
    with pytest.raises(ConfigError, match=r"square: disparities up to 20.0 px, the nearest slice is focused at 15.0"):
        photograph_pair(scene(), PhotographOptions(near_px=15), QUICK)


@pytest.mark.parametrize("options", [PhotographOptions(slices=0), PhotographOptions(near_px=1.0, far_px=2.0)])
def test_impossible_focus_range(options: PhotographOptions) -> None:
    with pytest.raises(ConfigError, match="expected 1 slice or more, and near_px above far_px"):
        focus_disparities(options)
