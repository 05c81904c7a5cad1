"""What is finished is known again by content; what changed, and only that, is done again."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from lfstereo.assets import asset_folder
from lfstereo.batch.figures import THUMBNAIL
from lfstereo.batch.jobs import Outcome
from lfstereo.batch.options import BatchOptions
from lfstereo.batch.plan import BatchRequest, plan_batch
from lfstereo.batch.record import append, record_path
from lfstereo.batch.stamps import counted_options, fingerprint, model_sha256, result_sha256, stamp, white_listing
from lfstereo.errors import AssetError, InputError, OutputError
from lfstereo.pipeline import RunOptions

MODEL = RunOptions().model


@pytest.fixture
def finished(tmp_path: Path) -> BatchRequest:
    """Two pairs, one of them finished with a white image."""
    for name in ("a", "b"):
        for side in ("left", "right"):
            path = tmp_path / "captures" / name / f"{side}.h5"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{name} {side}")
    shutil.copy(asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml", tmp_path / "rig.toml")
    (tmp_path / "whites").mkdir()
    (tmp_path / "whites" / "MOD_1.RAW").write_text("white")
    request = BatchRequest(
        tmp_path / "captures",
        tmp_path / "rig.toml",
        tmp_path / "whites",
        tmp_path / "out",
        RunOptions(),
        BatchOptions(),
    )
    result = request.output / "a"
    result.mkdir(parents=True)
    (result / THUMBNAIL).touch()
    (result / "run.toml").write_text("seconds = 1.234\n")
    inputs = {side: stamp(request.captures / "a" / f"{side}.h5") for side in ("left", "right")}
    inputs |= {"rig": stamp(request.rig), "white left": stamp(tmp_path / "whites" / "MOD_1.RAW")}
    weights = model_sha256(MODEL)
    outcome = Outcome("a", "done", inputs=inputs, weights_sha256=weights, result_sha256=result_sha256(result))
    found = fingerprint(inputs, request.run, outcome.weights_sha256, white_listing(request.whites))
    append(record_path(request.output, (1, 1)), outcome, found, counted_options(request.run), "0.1.0")
    return request


def why(request: BatchRequest) -> str:
    first = plan_batch(request).pairs[0]
    assert first.files.name == "a"
    assert first.finished == (not first.why)
    return first.why


def test_unchanged_is_finished(finished: BatchRequest) -> None:
    plan = plan_batch(finished)
    assert [pair.files.name for pair in plan.to_do] == ["b"]
    assert plan.to_do[0].why == "new"


def test_touched_copied_or_run_elsewhere_is_still_finished(finished: BatchRequest, tmp_path: Path) -> None:
    os.utime(finished.captures / "a" / "left.h5")
    assert why(finished) == ""
    shutil.move(finished.captures, tmp_path / "moved")
    shutil.move(tmp_path / "whites", tmp_path / "moved whites")
    elsewhere = replace(finished, captures=tmp_path / "moved", whites=tmp_path / "moved whites")
    assert why(replace(elsewhere, run=RunOptions(device="cpu"))) == ""


@pytest.mark.parametrize("role", ["left", "right"])
def test_changed_capture(finished: BatchRequest, role: str) -> None:
    path = finished.captures / "a" / f"{role}.h5"
    path.write_text("x" * path.stat().st_size)
    assert why(finished) == f"{role} changed"


def test_changed_rig_options_and_weights(finished: BatchRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    assert why(replace(finished, run=RunOptions(any_zoom=True))) == "option any_zoom changed"
    monkeypatch.setattr("lfstereo.batch.plan.model_sha256", lambda _: "other")
    assert why(finished) == "weights changed"
    monkeypatch.undo()
    finished.rig.write_text(finished.rig.read_text() + "\n")
    assert why(finished) == "rig changed"


def test_changed_or_new_white_images(finished: BatchRequest) -> None:
    assert finished.whites is not None
    (finished.whites / "MOD_2.RAW").write_text("nearer")
    assert why(finished) == "white images were added or removed"
    (finished.whites / "MOD_2.RAW").unlink()
    (finished.whites / "MOD_1.RAW").write_text("other")
    assert why(finished) == "white left changed"


def test_result_or_capture_that_is_gone(finished: BatchRequest) -> None:
    shutil.rmtree(finished.output / "a")
    assert why(finished) == "its result is gone"


def test_result_that_the_record_does_not_know(finished: BatchRequest) -> None:
    """As a batch with other options leaves it that is killed between result and record."""
    (finished.output / "a" / "run.toml").write_text("seconds = 1.235\n")
    assert why(finished) == "its result is not the recorded one"
    (finished.output / "a" / "run.toml").unlink()
    assert why(finished) == "its result is not the recorded one"


def test_failed_before(finished: BatchRequest) -> None:
    append(record_path(finished.output, (1, 1)), Outcome("a", "failed", "cut off"), "", {}, "")
    assert why(finished) == "failed before: cut off"


def test_result_without_record_is_made_again(finished: BatchRequest) -> None:
    record_path(finished.output, (1, 1)).unlink()
    assert why(finished) == "its record is missing"


def test_shards_share_the_pairs(finished: BatchRequest) -> None:
    parts = [plan_batch(replace(finished, batch=BatchOptions(shard=f"{i}/2"))).pairs for i in (1, 2)]
    assert [[pair.files.name for pair in part] for part in parts] == [["a"], ["b"]]


def test_foreign_folder_is_not_replaced(finished: BatchRequest) -> None:
    (finished.output / "b").mkdir()
    (finished.output / "b" / "diary.txt").touch()
    with pytest.raises(OutputError, match="is no result of a batch"):
        plan_batch(finished)


def test_no_white_folder(finished: BatchRequest, tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="found no such folder"):
        plan_batch(replace(finished, whites=tmp_path / "none"))


def test_no_pair(finished: BatchRequest) -> None:
    for path in finished.captures.rglob("right.h5"):
        path.unlink()
    with pytest.raises(InputError, match=r"found 2 captures and no pair by folder .*no other capture in its folder"):
        plan_batch(finished)
