"""``lfstereo run`` from the command line: a simulated pair in, depth out; and everything that can be wrong with it."""

from __future__ import annotations

import errno
import json
import shutil
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from lfstereo.cli.main import main
from lfstereo.container.serials import camera_mark
from lfstereo.depth import pictures
from lfstereo.depth.pfm import read_pfm
from lfstereo.depth.ply import read_ply
from lfstereo.depth.png16 import read_disparity_png
from lfstereo.errors import QualityWarning
from lfstereo.outputs import portable_name
from lfstereo.pipeline import open_light_field
from lfstereo.rig.rig import PlenopticCamera, StereoRig, write_rig

RESULT_FILES = {
    "all_in_focus.png",
    "centre_left.png",
    "centre_right.png",
    "depth.tiff",
    "disparity.pfm",
    "disparity.png",
    "disparity_colour.png",
    "focal_stack_left",
    "focal_stack_right",
    "mesh.glb",
    "overview.png",
    "point_cloud.ply",
    "report.html",
    "run.toml",
    "valid.png",
}
SMALL_MAE_PX = 8.0
"""A pair of 125 x 87 px: hardly larger than the disparities, so this only tells a map from noise."""


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "pair"
    assert main(["simulate", "-o", str(folder), "--sensor", "small", "--near-m", "0.8", "--far-m", "1.0"]) == 0
    return folder


@pytest.fixture(scope="module")
def result(pair: Path) -> Path:
    out = pair.parent / "result"
    assert main(words(pair, out, "--truth", str(pair / "truth"))) == 0
    return out


def words(pair: Path, out: Path, *more: str, left: Path | None = None, right: Path | None = None) -> list[str]:
    inputs = [str(left or pair / "left.LFR"), str(right or pair / "right.LFR")]
    return ["run", *inputs, "--rig", str(pair / "rig.toml"), "--whites", str(pair / "whites"), "-o", str(out), *more]


def refused(capsys: pytest.CaptureFixture[str], arguments: list[str], code: int = 3) -> str:
    """Run, expect the exit code, one line on stderr behind the bars and no output; return that line."""
    out = Path(arguments[arguments.index("-o") + 1])
    before = set(out.parent.iterdir())
    capsys.readouterr()
    assert main(arguments) == code
    assert set(out.parent.iterdir()) == before
    err = capsys.readouterr().err
    assert "Traceback" not in err
    (line,) = (row for row in err.splitlines() if row.startswith("lfstereo run:"))
    return line


def test_writes_everything(result: Path) -> None:
    assert {p.name for p in result.iterdir()} == RESULT_FILES
    assert len(list((result / "focal_stack_left").iterdir())) == 16
    disparity, known = read_pfm(result / "disparity.pfm")
    png, png_known = read_disparity_png(result / "disparity.png")
    valid = cv2.imread(str(result / "valid.png"), cv2.IMREAD_UNCHANGED) == 255
    np.testing.assert_array_equal(known, valid)
    assert valid.mean() > 0.2  # both cameras see it and the network is sure, on 125 x 87 px
    np.testing.assert_allclose(png[png_known], disparity[png_known], atol=1 / 256)
    record = tomllib.loads((result / "run.toml").read_text())
    geometry = record["geometry"]
    depth = tifffile.imread(result / "depth.tiff")
    assert depth.dtype == np.float32
    shift = disparity[valid] + geometry["doffs_px"]
    np.testing.assert_allclose(depth[valid], geometry["focal_px"] * geometry["baseline_m"] / shift, rtol=1e-5)
    cloud = read_ply(result / "point_cloud.ply")
    assert len(cloud.points_m) == record["summary"]["points"] > 100
    assert 0.3 < float(np.median(cloud.points_m[:, 2])) < 2.0
    accepted = {"any_zoom": False, "any_camera": False}
    assert record["run"] == {"slices": 16, "model": "binocular-v3", "device": "auto"} | accepted
    assert len(record["sha256"]["weights"]) == 64
    assert record["error"]["lfstereo"]["mae_px"] < SMALL_MAE_PX
    assert "SIM0000" not in (result / "run.toml").read_text()


def test_offline_the_same_bytes_come_out(pair: Path, result: Path, offline: None) -> None:
    """All but the times in run.toml and on the page; no connection is opened, no name looked up."""
    out = pair.parent / "again"
    assert main(words(pair, out, "--truth", str(pair / "truth"))) == 0
    timed = {"run.toml", "report.html"}
    files = [path.relative_to(result) for path in sorted(result.rglob("*")) if path.is_file()]
    assert len(files) > 40
    assert all(portable_name(part) == part for file in files for part in file.parts)
    assert len({str(file).lower() for file in files}) == len(files)
    different = [str(f) for f in files if f.name not in timed and (result / f).read_bytes() != (out / f).read_bytes()]
    assert different == []
    first, second = (tomllib.loads((folder / "run.toml").read_text()) for folder in (result, out))
    for record in (first, second):
        for table in ("seconds", "peak_gib"):
            record.pop(table, None)
    assert first == second


def test_json_summary_of_decoded_light_fields_is_the_same_map(
    pair: Path, result: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fields = []
    for side in ("left", "right"):
        fields.append(pair.parent / f"{side}.h5")
        whites = ["--whites", str(pair / "whites")]
        assert main(["decode", str(pair / f"{side}.LFR"), *whites, "-o", str(fields[-1])]) == 0
    out = pair.parent / "from_h5"
    capsys.readouterr()
    assert main(words(pair, out, "--json", left=fields[0], right=fields[1])) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["width"] == 125
    expected, known = read_pfm(result / "disparity.pfm")
    found, found_known = read_pfm(out / "disparity.pfm")
    both = known & found_known
    assert float(np.median(np.abs(found - expected)[both])) < 0.1


def test_folders_of_views(pair: Path, tmp_path: Path) -> None:
    """Views of a parallel pair of cameras, 12 px apart: nothing but the rig file says so."""
    scene = np.random.default_rng(3).random((96, 160, 3), dtype=np.float32)
    scene = cv2.GaussianBlur(scene, None, 1.0)
    scene = np.clip((scene - scene.mean()) * 3 + 0.5, 0, 1)
    for side, shift in (("left", 0), ("right", -12)):
        folder = tmp_path / side
        folder.mkdir()
        for s in range(3):
            picture = np.roll(scene, shift - (s - 1), axis=1)
            cv2.imwrite(str(folder / f"view_00_{s:02d}.png"), np.rint(picture * 255).astype(np.uint8))
    rig = StereoRig(*[parallel_camera()] * 2, (0.0, 0.0, 0.0), (-0.12, 0.0, 0.0), 0.8, 12.0, 1.0)
    write_rig(tmp_path / "rig.toml", rig)
    out = tmp_path / "out"
    arguments = words(pair, out, left=tmp_path / "left", right=tmp_path / "right")
    arguments[arguments.index("--rig") + 1] = str(tmp_path / "rig.toml")
    assert main(arguments) == 0
    disparity, known = read_pfm(out / "disparity.pfm")
    assert known.mean() > 0.5
    # f B / z = 12 px at 1 m per 100 px of focal length; the far end of the range is taken off.
    assert float(np.median(disparity[known])) == pytest.approx(12 - 1, abs=1.0)


def parallel_camera() -> PlenopticCamera:
    """Views that move by 1 px per 0.01 m for a wall at 1 m, focused at infinity."""
    return PlenopticCamera("", (160, 96), (100.0, 100.0), (79.5, 47.5), 1e6, 0.01)


def test_refuses_an_existing_output(pair: Path, result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "exists already" in refused(capsys, words(pair, result))
    assert {p.name for p in result.iterdir()} == RESULT_FILES


def test_not_a_lytro_file(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fake = tmp_path / "in" / "left.LFR"
    fake.parent.mkdir()
    fake.write_bytes(b"\xff\xd8\xff\xe0 this is a JPEG")
    line = refused(capsys, words(pair, tmp_path / "out", left=fake))
    assert str(fake) in line
    assert "Lytro" in line


def test_missing_file(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, words(pair, tmp_path / "out", left=tmp_path / "no.LFR"))
    assert "no.LFR" in line


def test_truncated_file(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "in" / "left.LFR"
    cut.parent.mkdir()
    cut.write_bytes((pair / "left.LFR").read_bytes()[:1_000_000])
    line = refused(capsys, words(pair, tmp_path / "out", left=cut))
    assert str(cut) in line
    assert "1000000" in line


def test_flipped_byte(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "in" / "left.LFR"
    bad.parent.mkdir()
    content = bytearray((pair / "left.LFR").read_bytes())
    content[len(content) // 2] ^= 0x40
    bad.write_bytes(content)
    assert "SHA-1" in refused(capsys, words(pair, tmp_path / "out", left=bad))


def test_no_white_image_of_this_camera(pair: Path, tmp_path: Path) -> None:
    whites = tmp_path / "whites"
    shutil.copytree(pair / "whites" / "SIM00000002", whites / "SIM00000002")
    told = "camera #0124, expected #1d1c .* estimated from the picture itself: 9.% of its lenslets agree"
    with pytest.warns(QualityWarning, match=told):
        open_light_field(pair / "left.LFR", whites)


def test_raw_capture_without_white_images(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = words(pair, tmp_path / "out")
    at = arguments.index("--whites")
    del arguments[at : at + 2]
    assert main(arguments) == 0
    assert capsys.readouterr().err.count("lfstereo run: warning: ") == 2


def test_captures_swapped(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, words(pair, tmp_path / "out", left=pair / "right.LFR", right=pair / "left.LFR"))
    assert camera_mark("SIM00000002") in line


def test_rig_of_other_cameras(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text((pair / "rig.toml").read_text().replace("SIM00000002", "B5143909630"))
    arguments = words(pair, tmp_path / "out")
    arguments[arguments.index("--rig") + 1] = str(rig)
    assert camera_mark("B5143909630") in refused(capsys, arguments)


def test_rig_of_another_zoom(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    text = (pair / "rig.toml").read_text().replace("SIM00000002", "B5143909630")
    assert "zoom_step = 105" in text
    rig.write_text(text.replace("zoom_step = 105", "zoom_step = 106"))
    arguments = words(pair, tmp_path / "out")
    arguments[arguments.index("--rig") + 1] = str(rig)
    assert "left.LFR: taken at zoom step 105, but the rig's left" in refused(capsys, arguments)
    assert f"the rig's right camera is {camera_mark('B5143909630')}" in refused(capsys, [*arguments, "--any-zoom"]), (
        "the left is accepted"
    )


def test_light_fields_of_different_size(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from lfstereo.lightfield.field import LightField
    from lfstereo.lightfield.store import read_light_field, write_light_field

    field = tmp_path / "in" / "right.h5"
    field.parent.mkdir()
    assert main(["decode", str(pair / "right.LFR"), "--whites", str(pair / "whites"), "-o", str(field)]) == 0
    whole = read_light_field(field)
    assert whole.weight is not None
    fewer = LightField(
        np.ascontiguousarray(whole.views[1:-1, 1:-1]),
        np.ascontiguousarray(whole.weight[1:-1, 1:-1]),
        whole.sampling,
        whole.serial,
        whole.source,
    )
    write_light_field(tmp_path / "in" / "fewer.h5", fewer)
    line = refused(capsys, words(pair, tmp_path / "out", right=tmp_path / "in" / "fewer.h5"))
    assert "(13, 13" in line
    assert "(15, 15" in line


def test_disk_full(
    pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tifffile, "imwrite", full)
    assert "disk is full" in refused(capsys, words(pair, tmp_path / "out"))


def test_bad_options(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "run.toml"
    config.write_text("[run]\nslcies = 3\n")
    assert "'slcies' is not an option" in refused(capsys, words(pair, tmp_path / "out", "--config", str(config)))
    assert "slices = 1, expected 5 to 64" in refused(capsys, words(pair, tmp_path / "out", "--slices", "1"))
    assert "nosuch" in refused(capsys, words(pair, tmp_path / "out", "--model", "nosuch"))


def test_truth_that_is_none(pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "disparity.pfm" in refused(capsys, words(pair, tmp_path / "out", "--truth", str(pair)))
    truth = tmp_path / "truth"
    truth.mkdir()
    pictures.write_png(truth / "a.png", np.zeros((2, 2), np.uint8))
    from lfstereo.depth.pfm import write_pfm

    write_pfm(truth / "disparity.pfm", np.ones((3, 4), np.float32))
    assert "(3, 4)" in refused(capsys, words(pair, tmp_path / "out", "--truth", str(truth)))
