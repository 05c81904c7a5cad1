"""Refocusing against what the Light Field Toolbox v0.5.3 computed on the same light field."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField

TOLERANCE = 2e-4  # linear RGB; weights are rounded to 8 bits here
BORDER_PX = 8  # the toolbox repeats the edge, here what lies outside a view has no weight


def test_equals_shift_sum_of_the_light_field_toolbox(real_data: Path) -> None:
    folder = real_data / "lftoolbox_reference" / "crop600"
    decoded = np.load(folder / "decoded.npz")["LF"].astype(np.float32) / 65535
    weight = np.rint(decoded[..., 3] * 255).astype(np.uint8)
    field = LightField(np.ascontiguousarray(decoded[..., :3]), weight, None, "", "toolbox")
    reference = np.load(folder / "filters.npz")
    # Its views lie at slope * N * linspace(-1/2, 1/2, N), and its slope grows with distance.
    slopes = -reference["slopes"].ravel() * 15 / 14
    found = refocus(field, slopes, RefocusOptions(aperture="all"))
    inner = slice(BORDER_PX, -BORDER_PX)
    for k, picture in enumerate(found):
        expected = reference[f"sum{k + 1}"][..., :3]
        np.testing.assert_allclose(picture[inner, inner], expected[inner, inner], atol=TOLERANCE)
