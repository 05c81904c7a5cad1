"""Find a hexagonal lattice in the spectrum of a frame: first roughly, then by its local phases."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64
from lfstereo.errors import GridFitError
from lfstereo.lenslet.lattice import Lattice

_PITCH_RANGE_PX = (5.5, 40.0)
_TILE = 512
_CANDIDATES = 24
_LEAST_CONTRAST = 15.0
"""A lattice peak must stand this many times above the median of its annulus."""


def coarse_frequencies(flat: Float32, where: str) -> Float64:
    """Find the lattice's two basic frequencies in the averaged spectrum of nine tiles.

    Parameters
    ----------
    flat
        ``(H, W)`` evened-out frame, see :func:`lfstereo.lenslet.flatten.flatten`.
    where
        Name of the frame, for messages.

    Returns
    -------
    ``(2, 2)`` frequencies in cycles per px, rows ``i`` and ``j``, good to about 1e-4.

    Raises
    ------
    GridFitError
        If the frame shows no hexagonal lattice whose rows run along x to within 30 degrees.
    """
    power, tile = _mean_power(flat)
    frequency = np.fft.fftshift(np.fft.fftfreq(tile))
    fx, fy = np.meshgrid(frequency, frequency)
    radius = np.hypot(fx, fy)
    annulus = (radius > 0.9 / _PITCH_RANGE_PX[1]) & (radius < 1.2 / _PITCH_RANGE_PX[0])
    magnitude = np.where(annulus, np.sqrt(power), 0).astype(np.float32)
    level = float(np.median(magnitude[annulus]))
    top = cv2.dilate(magnitude, np.ones((5, 5), np.uint8))
    rows, columns = np.nonzero((magnitude == top) & (magnitude > _LEAST_CONTRAST * level))
    order = np.argsort(-magnitude[rows, columns])[: 2 * _CANDIDATES]
    peaks = [_refine(magnitude, int(rows[k]), int(columns[k]), tile) for k in order]
    return _hexagonal_pair(peaks, where)


def _mean_power(flat: Float32) -> tuple[Float32, int]:
    height, width = flat.shape
    tile = min(_TILE, 2 ** int(np.log2(min(height, width))))
    window = np.outer(np.hanning(tile), np.hanning(tile)).astype(np.float32)
    power = np.zeros((tile, tile), np.float32)
    for fraction_y in (0.15, 0.5, 0.85):
        for fraction_x in (0.15, 0.5, 0.85):
            y, x = round(fraction_y * (height - tile)), round(fraction_x * (width - tile))
            part = flat[y : y + tile, x : x + tile]
            power += np.abs(np.fft.fft2((part - part.mean()) * window)).astype(np.float32) ** 2
    return np.asarray(np.fft.fftshift(power), np.float32), tile


def _refine(magnitude: Float32, row: int, column: int, tile: int) -> tuple[float, float, float]:
    log = np.log(np.maximum(magnitude[row - 1 : row + 2, column - 1 : column + 2], 1e-12))

    def vertex(before: float, at: float, after: float) -> float:
        bend = before - 2 * at + after
        return 0.0 if bend >= 0 else float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))

    dx, dy = vertex(*log[1, :]), vertex(*log[:, 1])
    return (column - tile // 2 + dx) / tile, (row - tile // 2 + dy) / tile, float(magnitude[row, column])


def _hexagonal_pair(peaks: list[tuple[float, float, float]], where: str) -> Float64:
    best, best_score = None, 0.0
    for fx, fy, strength in peaks:
        angle = np.degrees(np.arctan2(fy, fx))
        # The frequency of j points down the rows; that of i lies 120 degrees from it, to the right and up.
        if not 60 <= angle < 120:
            continue
        for gx, gy, other in peaks:
            turned = (angle - np.degrees(np.arctan2(gy, gx))) % 360
            ratio = np.hypot(gx, gy) / np.hypot(fx, fy)
            third = [m for hx, hy, m in peaks if np.hypot(hx - fx - gx, hy - fy - gy) < 0.004]
            if abs(turned - 120) < 6 and 0.92 < ratio < 1.09 and third:
                score = (strength * other * max(third)) ** (1 / 3)
                if score > best_score:
                    best, best_score = ((gx, gy), (fx, fy)), score
    if best is None:
        raise GridFitError(
            f"{where}: no hexagonal lenslet pattern of {_PITCH_RANGE_PX[0]:g} to {_PITCH_RANGE_PX[1]:g} px pitch "
            f"in its spectrum; give a raw lenslet frame"
        )
    return np.asarray(best, np.float64)


def lattice_from_phases(flat: Float32, frequencies: Float64) -> Lattice:
    """Fit a lattice to the phases that a frame shows at the lattice's three basic frequencies.

    Each block of about eight lenslets gives one phase per frequency, which is the position of its
    micro-images along that frequency; a robust plane through the phases gives frequency and origin.

    Parameters
    ----------
    flat
        ``(H, W)`` evened-out frame.
    frequencies
        ``(2, 2)`` rough frequencies in cycles per px, rows ``i`` and ``j``.

    Returns
    -------
    The lattice, good to about 0.05 px everywhere.
    """
    pitch = 2 / (np.sqrt(3) * float(np.hypot(*frequencies[1])))
    block = int(np.clip(round(8 * pitch), 16, min(flat.shape) // 3))
    modes = np.array([[1, 0], [0, 1], [1, 1]])
    planes = [_phase_plane(flat, mode @ frequencies, block) for mode in modes]
    # Three measured planes, two unknown ones: i, j and i + j; offsets are known up to whole cycles.
    planes[2][2] += round(planes[0][2] + planes[1][2] - planes[2][2])
    design = np.kron(modes, np.eye(3))
    solved = np.linalg.lstsq(design, np.concatenate(planes), rcond=None)[0].reshape(2, 3)
    basis = np.asarray(np.linalg.inv(solved[:, :2]), np.float64)
    return Lattice(origin=-basis @ solved[:, 2], row=basis[:, 0].copy(), diagonal=basis[:, 1].copy())


def _phase_plane(flat: Float32, frequency: Float64, block: int) -> Float64:
    """Return ``(fx, fy, offset)`` so that the lattice coordinate is ``fx x + fy y + offset`` cycles."""
    phasor, centres_x, centres_y = _demodulate(flat, frequency, block)
    slope = np.zeros(2)
    for axis, spacing in ((1, block), (0, block)):
        ahead, behind = (phasor[:, 1:], phasor[:, :-1]) if axis == 1 else (phasor[1:], phasor[:-1])
        turn = ahead * behind.conj() / np.maximum(np.abs(ahead), 1e-12)
        slope[1 - axis] = np.angle(turn.sum()) / (2 * np.pi * spacing)
    x, y = np.meshgrid(centres_x, centres_y)
    weight = np.minimum(np.abs(phasor), np.median(np.abs(phasor)))
    detrended = phasor * np.exp(-2j * np.pi * (slope[0] * x + slope[1] * y))
    offset = np.angle((detrended * weight / np.maximum(np.abs(phasor), 1e-12)).sum()) / (2 * np.pi)
    for _ in range(6):
        residual = np.angle(detrended * np.exp(-2j * np.pi * offset)) / (2 * np.pi)
        spread = max(1.4826 * float(np.median(np.abs(residual))), 1e-4)
        robust = (weight / (1 + (residual / (2 * spread)) ** 2)).ravel()
        design = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
        normal = design.T @ (design * robust[:, None])
        step = np.linalg.solve(normal, design.T @ (robust * residual.ravel()))
        slope += step[:2]
        offset += step[2]
        detrended = phasor * np.exp(-2j * np.pi * (slope[0] * x + slope[1] * y))
    return np.array([frequency[0] + slope[0], frequency[1] + slope[1], offset])


def _demodulate(flat: Float32, frequency: Float64, block: int) -> tuple[npt.NDArray[np.complex128], Float64, Float64]:
    """Return the Hann-weighted Fourier coefficient of every block, its phase referred to pixel (0, 0)."""
    height, width = flat.shape
    count_y, count_x = height // block, width // block
    window = np.hanning(block + 2)[1:-1].astype(np.float32)
    x = np.arange(count_x * block)
    carrier = np.exp(-2j * np.pi * frequency[0] * x).reshape(count_x, block) * window
    out = np.empty((count_y, count_x), np.complex128)
    mean = float(window.sum()) ** 2
    for n in range(count_y):
        y = np.arange(n * block, (n + 1) * block)
        wave = np.exp(-2j * np.pi * frequency[1] * y) * window
        strip = flat[n * block : (n + 1) * block, : count_x * block]
        level = float(strip.mean())
        rows = np.stack([wave.real, wave.imag]).astype(np.float32) @ (strip - level)
        out[n] = ((rows[0] + 1j * rows[1]).reshape(count_x, block) * carrier).sum(1) / mean
    centre = (block - 1) / 2
    return out, np.arange(count_x) * block + centre, np.arange(count_y) * block + centre
