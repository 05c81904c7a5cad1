"""Shift views by any part of a pixel through their spectrum: exact for what the sampling holds.

A view's spectrum is that of an endless tiling of it. So that no edge comes up where copies meet, each view first gets
a margin in which its mirrored right end turns smoothly into its mirrored left end; beyond its border a view therefore
goes on mirrored, where the other shifts let it end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.fft

from lfstereo.arrays import Float32, Float64
from lfstereo.lightfield.field import LightField
from lfstereo.progress import Progress, silent

Complex64: TypeAlias = npt.NDArray[np.complex64]
Index: TypeAlias = npt.NDArray[np.intp]
_BLEND_PX = 32
"""Width in which one end of a view turns into the other, beyond what the shifts reach."""
_LEAST_WEIGHT = 1e-3


def refocus_by_spectrum(
    light_field: LightField, slopes_px: Float64, aperture: Float32, progress: Progress = silent
) -> Float32:
    """Return the weighted mean of the views, shifted exactly, for each slope.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    slopes_px
        ``(K,)`` px per view.
    aperture
        ``(T, S)`` how much each view counts.
    progress
        Told the view rows done.

    Returns
    -------
    Float32
        ``(K, V, U, 3)``.
    """
    count_t, rows, columns = light_field.views.shape[0], *light_field.views.shape[2:4]
    t0, s0 = light_field.centre
    margin = _margin(light_field, slopes_px)
    size = scipy.fft.next_fast_len(rows + margin, real=True), scipy.fft.next_fast_len(columns + margin, real=True)
    frequency_v, frequency_u = scipy.fft.fftfreq(size[0]), scipy.fft.rfftfreq(size[1])
    channels = 3 if light_field.weight is None else 4
    summed = np.zeros((len(slopes_px), channels, size[0], len(frequency_u)), np.complex64)
    for t in range(count_t):
        among = np.flatnonzero(aperture[t] > 0)
        spectra = [aperture[t, s] * _spectrum(light_field, t, int(s), size) for s in among]
        for k, slope in enumerate(slopes_px):
            across = _phases(frequency_u, slope * (among - s0))
            down = _phases(frequency_v, np.array([slope * (t - t0)]))[0]
            for spectrum, phase in zip(spectra, across, strict=True):
                summed[k] += spectrum * (phase[None, :] * down[:, None])
        progress(t + 1, count_t)
    slices = np.empty((len(slopes_px), rows, columns, 3), np.float32)
    for k, spectrum in enumerate(summed):
        picture = scipy.fft.irfft2(spectrum, size, workers=-1)[:, :rows, :columns]
        slices[k] = _colours(picture, float(aperture.sum()), light_field, light_field.centre)
    return slices


def shift_by_spectrum(light_field: LightField, slope: float) -> LightField:
    """Return the light field with its views shifted exactly, so that what lies at a slope lies at slope 0."""
    count_t, count_s, rows, columns = light_field.views.shape[:4]
    t0, s0 = light_field.centre
    margin = _margin(light_field, np.array([slope]))
    size = scipy.fft.next_fast_len(rows + margin, real=True), scipy.fft.next_fast_len(columns + margin, real=True)
    views = np.empty_like(light_field.views)
    weight = None if light_field.weight is None else np.empty_like(light_field.weight)
    for t in range(count_t):
        down = _phases(scipy.fft.fftfreq(size[0]), np.array([slope * (t - t0)]))[0]
        for s in range(count_s):
            across = _phases(scipy.fft.rfftfreq(size[1]), np.array([slope * (s - s0)]))[0]
            spectrum = _spectrum(light_field, t, s, size) * (across[None, :] * down[:, None])
            picture = scipy.fft.irfft2(spectrum, size, workers=-1)[:, :rows, :columns]
            views[t, s] = _colours(picture, 1.0, light_field, (t, s))
            if weight is not None:
                weight[t, s] = np.rint(255 * np.clip(picture[3], 0, 1)).astype(np.uint8)
    return replace(light_field, views=views, weight=weight)


def _margin(light_field: LightField, slopes_px: Float64) -> int:
    views_away = max(light_field.views.shape[0], light_field.views.shape[1]) / 2
    return _BLEND_PX + 2 * int(np.ceil(np.abs(slopes_px).max() * views_away))


def _spectrum(light_field: LightField, t: int, s: int, size: tuple[int, int]) -> Complex64:
    """Return the spectrum ``(3 or 4, size)`` of one view: colours, or colours times weight, and weight."""
    planes = light_field.views[t, s].transpose(2, 0, 1)
    if light_field.weight is not None:
        share = light_field.weight[t, s].astype(np.float32) / np.float32(255)
        planes = np.concatenate([np.where(share > 0, planes, np.float32(0)) * share, share[None]])
    for axis, length in ((1, size[0]), (2, size[1])):
        planes = _closed(planes, axis, length)
    return np.asarray(scipy.fft.rfft2(planes, workers=-1), np.complex64)


def _closed(planes: Float32, axis: int, length: int) -> Float32:
    """Lengthen an axis to a period without a step: after the end it goes on mirrored and turns into the beginning."""
    count = planes.shape[axis]
    extra = length - count
    steps = np.arange(extra)
    after = np.take(planes, _mirrored(count + steps, count), axis)
    before = np.take(planes, _mirrored(steps - extra, count), axis)
    shape = [1, 1, 1]
    shape[axis] = extra
    share = (0.5 - 0.5 * np.cos(np.pi * (steps + 1) / (extra + 1))).astype(np.float32).reshape(shape)
    return np.concatenate([planes, (1 - share) * after + share * before], axis)


def _mirrored(index: Index, count: int) -> Index:
    if count == 1:
        return np.zeros_like(index)
    folded = np.abs(index) % (2 * count - 2)
    return np.where(folded < count, folded, 2 * count - 2 - folded)


def _phases(frequencies: Float64, shifts_px: Float64) -> Complex64:
    """Return ``(shifts, frequencies)`` factors that move a signal to larger coordinates by each shift."""
    phases: Complex64 = np.exp(-2j * np.pi * shifts_px[:, None] * frequencies[None, :]).astype(np.complex64)
    return phases


def _colours(picture: Float32, total: float, light_field: LightField, view: tuple[int, int]) -> Float32:
    """Divide by the weight; a pixel that no weight reaches keeps the view's own value."""
    if len(picture) == 3:
        mean: Float32 = picture.transpose(1, 2, 0) / np.float32(total)
        return mean
    reached = picture[3] > _LEAST_WEIGHT * total
    colours = picture[:3] / np.where(reached, picture[3], 1)
    own = light_field.views[view].transpose(2, 0, 1)
    shown: Float32 = np.where(reached, colours, own).transpose(1, 2, 0)
    return shown
