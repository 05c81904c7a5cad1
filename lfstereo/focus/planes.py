"""The planes of focus of a stack: given one by one, between limits, or between what the scene itself spans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.conventions import SLICES_DEFAULT
from lfstereo.errors import ConfigError
from lfstereo.focus.lftoolbox import SlopeRule, slopes_by_rule
from lfstereo.focus.scale import FocusScale, FocusUnit
from lfstereo.focus.slope_map import find_focus_range
from lfstereo.lightfield.field import LightField
from lfstereo.options import option
from lfstereo.progress import Progress, silent


@dataclass(frozen=True, slots=True)
class FocusPlanesOptions:
    """Where the slices of a stack are focused."""

    at: tuple[float, ...] = option((), "focus at these values, instead of slices between two limits")
    near: float | None = option(None, "nearest plane of focus; unset: where the scene begins")
    far: float | None = option(None, "farthest plane of focus; unset: where the scene ends")
    unit: Literal["slope", "disparity", "metres"] = option(
        "slope", "what these numbers are: slopes in px per view, or with a rig disparities in px or depths in metres"
    )
    slices: int = option(SLICES_DEFAULT, "planes between the limits, even in slope and disparity")
    slope_rule: SlopeRule = option(
        "per-view", "slopes are px per view, nearer positive; or the Light Field Toolbox's, N / (N - 1) farther apart"
    )


def choose_slopes(
    fields: Sequence[LightField],
    options: FocusPlanesOptions = FocusPlanesOptions(),
    scale: FocusScale | None = None,
    progress: Progress = silent,
) -> Float64:
    """Return the slopes ``(K,)`` at which to focus, falling from near to far unless they were given one by one.

    Parameters
    ----------
    fields
        One light field, or those of both cameras of a rectified pair, where the limits span both scenes.
    options
        The planes.
    scale
        How slopes go with disparities and depths, where a rig tells.
    progress
        Told the work of finding the limits.

    Raises
    ------
    ConfigError
        If an option is not possible, or the unit needs a rig.
    QualityError
        If the scene has too little texture to tell its limits.
    """
    if options.unit != "slope" and scale is None:
        raise ConfigError(f"unit = '{options.unit}': found no rig, expected one to tell it from slopes; give --rig")
    if options.slope_rule != "per-view" and options.unit != "slope":
        raise ConfigError(f"slope_rule = '{options.slope_rule}': found the unit '{options.unit}', expected slope")
    if options.at:
        return _slopes(np.array(options.at), fields[0], options, scale)
    if options.slices < 2:
        raise ConfigError(f"slices = {options.slices}: expected at least 2; for one picture give --at")
    found = []
    if options.near is None or options.far is None:
        found = [find_focus_range(field, progress=progress) for field in fields]
    ends = (
        _slopes(np.array([value]), fields[0], options, scale)[0] if value is not None else limit(spans)
        for value, limit, spans in (
            (options.near, max, [span.near for span in found]),
            (options.far, min, [span.far for span in found]),
        )
    )
    near, far = ends
    if not near > far:
        raise ConfigError(f"limits: found slopes from {near:.4g} to {far:.4g} px per view, expected near above far")
    return np.linspace(near, far, options.slices)


def _slopes(values: Float64, field: LightField, options: FocusPlanesOptions, scale: FocusScale | None) -> Float64:
    unit: FocusUnit = options.unit
    if scale is not None:
        values = scale.slopes(values, unit)
    slopes = slopes_by_rule(values, options.slope_rule, field.views.shape[1])
    if not np.all(np.isfinite(slopes)):
        raise ConfigError(f"planes of focus {tuple(values)}: expected finite numbers")
    return slopes
