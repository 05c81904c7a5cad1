"""The thin lens: against the simulated camera, a real first-generation camera, and the bounds of a calibration."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.rig.thin_lens import ThinLens, lens_bounds, thin_lens_of_camera, thin_lens_of_metadata
from lfstereo.simulate.frame_metadata import picture_metadata
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig

METADATA_TOLERANCE = 0.05
"""Relative, of a real camera's pupil against its calibration by the Light Field Toolbox."""


def test_agrees_with_the_simulated_camera() -> None:
    camera = build_rig(SimulateOptions()).left
    lens = ThinLens(
        camera.focal_length_m, camera.image_distance_m, camera.lenslet_gap_m, camera.image_distance_m, 1.4e-6
    )
    truth = camera.plenoptic()
    assert lens.focal_px == pytest.approx(truth.focal_px[0], rel=1e-9)
    assert lens.pupil_m_per_px == pytest.approx(truth.pupil_m_per_px, rel=1e-9)
    assert 1 / lens.vergence_per_m == pytest.approx(truth.focus_distance_m, rel=1e-9)
    found = thin_lens_of_camera(truth, lens)
    for name in ("focal_length_m", "image_distance_m", "lenslet_gap_m"):
        assert getattr(found, name) == pytest.approx(getattr(lens, name), rel=1e-9), name


def test_the_truth_lies_within_the_bounds_of_the_metadata() -> None:
    rig = build_rig(SimulateOptions())
    for camera in (rig.left, rig.right):
        start = thin_lens_of_metadata(picture_metadata(camera, "left"))
        bounds, truth = lens_bounds(start), camera.plenoptic()
        assert start.focal_length_m == pytest.approx(camera.focal_length_m, rel=1e-3)
        assert bounds.focal_px[0] < truth.focal_px[0] < bounds.focal_px[1]
        assert bounds.pupil_m_per_px[0] < truth.pupil_m_per_px < bounds.pupil_m_per_px[1]
        assert bounds.vergence_per_m[0] < 1 / truth.focus_distance_m < bounds.vergence_per_m[1]


def test_a_real_camera_s_metadata_tell_its_calibration(real_data: Path) -> None:
    """Of two first-generation cameras at zoom steps 981 and 982; the toolbox's px are 0.866 lenslets wide."""
    frame = json.loads((real_data / "raw/illum_metadata/IMG_0001__frame.json").read_text())
    published = json.loads((real_data / "raw/jaramillo_f01/CalSamples/CalInfo.json").read_text())
    devices = next(found for found in _tables(frame) if "mla" in found and "lens" in found)
    metadata = read_camera_profile("lytro-f01")
    lens = dataclasses.replace(
        metadata.lens,
        focal_length_m=devices["lens"]["focalLength"],
        exit_pupil_offset_m=devices["lens"]["exitPupilOffset"]["z"],
    )
    z = devices["mla"]["sensorOffset"]["z"]
    lenslets = dataclasses.replace(metadata.lenslets, offset_m=(0.0, 0.0, z))
    start = thin_lens_of_metadata(dataclasses.replace(metadata, lens=lens, lenslets=lenslets))
    matrix = published["EstCamIntrinsicsH"]
    px = published["LensletGridModel"]["VSpacing"]
    assert start.focal_px == pytest.approx(px / matrix[2][2], rel=METADATA_TOLERANCE)
    assert start.pupil_m_per_px == pytest.approx(matrix[0][0], rel=METADATA_TOLERANCE)


def _tables(found: object) -> list[dict]:
    if isinstance(found, list):
        return [table for entry in found for table in _tables(entry)]
    if not isinstance(found, dict):
        return []
    return [found, *(table for entry in found.values() for table in _tables(entry))]
