"""Shift-and-add on a graphics card: two convolutions, first along image rows, then along columns.

All views of a view row are the channels of one convolution along image rows, whose output channels are the slices;
what it gives is convolved along image columns, each slice on its own. A shift by parts of a pixel is a kernel with two
or four gains in it. The light field is brought to the device once and serves any number of stacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from lfstereo.arrays import Float32, Float64
from lfstereo.errors import ConfigError
from lfstereo.focus.aperture import RefocusOptions, aperture_weights
from lfstereo.focus.shift_kernels import LEAST_WEIGHT, TAPS, tap_gains
from lfstereo.lightfield.field import LightField


@dataclass(frozen=True, slots=True)
class ResidentViews:
    """A light field in the memory of a device, as the convolutions read it."""

    samples: torch.Tensor
    """``(T * V * 4, S, U)`` float32: colours times weight, and weight, 0 to 1."""
    centre_view: torch.Tensor
    """``(V, U, 3)``."""
    centre: tuple[int, int]
    rows_of_views: int
    rows: int


def to_device(light_field: LightField, device: str) -> ResidentViews:
    """Bring a light field to a device: ``"cpu"``, or ``"cuda"`` for a graphics card.

    Raises
    ------
    ConfigError
        If there is no such device.
    """
    if device.startswith("cuda") and not torch.cuda.is_available():
        raise ConfigError(f"device '{device}': found no graphics card that torch can use; give --device cpu")
    count_t, count_s, rows, columns = light_field.views.shape[:4]
    samples = torch.empty((count_t, rows, 4, count_s, columns), dtype=torch.float32, device=device)
    for t in range(count_t):
        colours = torch.from_numpy(np.ascontiguousarray(light_field.views[t])).to(device)
        if light_field.weight is None:
            samples[t, :, 3] = 1.0
            samples[t, :, :3] = colours.permute(1, 3, 0, 2)
        else:
            share = torch.from_numpy(np.ascontiguousarray(light_field.weight[t])).to(device).float() / 255
            samples[t, :, 3] = share.permute(1, 0, 2)
            seen = torch.where(share[..., None] > 0, colours * share[..., None], torch.zeros_like(colours))
            samples[t, :, :3] = seen.permute(1, 3, 0, 2)
    centre_view = torch.from_numpy(np.ascontiguousarray(light_field.views[light_field.centre])).to(device)
    flat = samples.reshape(count_t * rows * 4, count_s, columns)
    return ResidentViews(flat, centre_view, light_field.centre, count_t, rows)


def refocus_resident(views: ResidentViews, slopes_px: Float64, aperture: Float32, cubic: bool = False) -> torch.Tensor:
    """Return the mean of the views at each slope, ``(K, V, U, 3)``, as :func:`lfstereo.focus.refocus.refocus` has it.

    Parameters
    ----------
    views
        A light field on a device.
    slopes_px
        ``(K,)`` px per view.
    aperture
        ``(T, S)`` how much each view counts.
    cubic
        By four neighbours instead of two along each axis.
    """
    device, count = views.samples.device, len(slopes_px)
    t0, s0 = views.centre
    count_t, count_s, columns = views.rows_of_views, views.samples.shape[1], views.samples.shape[2]
    across = torch.from_numpy(_kernels(slopes_px[:, None] * (np.arange(count_s) - s0), cubic)).to(device)
    down = torch.from_numpy(_kernels(slopes_px[:, None] * (np.arange(count_t) - t0), cubic)).to(device)
    gains = torch.from_numpy(aperture).to(device)
    summed = torch.zeros((columns, count, views.rows, 4), dtype=torch.float32, device=device)
    rows = views.samples.reshape(count_t, views.rows * 4, count_s, columns)
    with torch.no_grad(), torch.backends.cudnn.flags(enabled=True, allow_tf32=False):
        for t in range(count_t):
            along = functional.conv1d(rows[t], across * gains[t, None, :, None], padding=across.shape[2] // 2)
            columns_of = along.reshape(views.rows, 4, count, columns).permute(3, 1, 2, 0)
            moved = functional.conv1d(
                columns_of.reshape(columns * 4, count, views.rows),
                down[:, t : t + 1].contiguous(),
                padding=down.shape[2] // 2,
                groups=count,
            )
            summed += moved.reshape(columns, 4, count, views.rows).permute(0, 2, 3, 1)
    weight = summed[..., 3:]
    reached = weight > LEAST_WEIGHT
    pictures = summed[..., :3] / torch.where(reached, weight, torch.ones_like(weight))
    shown = torch.where(reached, pictures, views.centre_view.permute(1, 0, 2)[:, None])
    return shown.permute(1, 2, 0, 3)


def refocus_on_device(
    light_field: LightField, slopes_px: Float64, options: RefocusOptions = RefocusOptions(), device: str = "cuda"
) -> Float32:
    """Refocus on a device and bring the slices back, ``(K, V, U, 3)``.

    Raises
    ------
    ConfigError
        If there is no such device, or the options ask for more than a mean of linear or cubic shifts.
    """
    if options.reduction != "mean" or any(options.tilt) or options.interpolation == "fourier" or options.least_weight:
        raise ConfigError(
            f"device '{device}': found reduction '{options.reduction}', interpolation '{options.interpolation}', tilt "
            f"{options.tilt}, least_weight {options.least_weight}, expected the mean of linear or cubic shifts alone; "
            "leave --device out"
        )
    views = to_device(light_field, device)
    aperture = aperture_weights(light_field, options)
    slices = refocus_resident(views, np.asarray(slopes_px, np.float64), aperture, options.interpolation == "cubic")
    return np.ascontiguousarray(slices.cpu().numpy())


def _kernels(shifts_px: Float64, cubic: bool) -> Float32:
    """Return ``(*shifts, L)`` odd-sized kernels whose correlation shifts a row, zero beyond its ends."""
    reach = int(np.ceil(np.abs(shifts_px).max())) + 2
    kernels = np.zeros((*shifts_px.shape, 2 * reach + 1), np.float32)
    gains = np.empty(TAPS, np.float32)
    for place in np.ndindex(shifts_px.shape):
        first = tap_gains(float(shifts_px[place]), cubic, gains)
        for j, gain in enumerate(gains):
            if gain != 0:
                kernels[place][reach - first - j] += gain
    return kernels
