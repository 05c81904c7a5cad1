"""Draw what the models and SGBM + WLS make of rendered scenes, beside the truth, errors included.

Run: ``python benchmarks/draw_models.py -o models/comparison.jpg``. Scenes have seeds and textures that training never
saw; the stacks are those of ``lfstereo evaluate --synthetic``, but of furnished rooms.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from lfstereo.network.estimate import estimate_disparity, load_network
from lfstereo.network.shipped import DEFAULT_MODEL
from lfstereo.training.atlas import mixed_bank
from lfstereo.training.evaluate import HELD_OUT_SEED
from lfstereo.training.generated_dataset import dual_stack_of
from lfstereo.training.rows import wls_filled
from lfstereo.training.samples import stack_sample

SIZE, WORST_PX = (320, 512), 8.0
SCENES = 3
MARGIN, LABEL_PX = 6, 22


def coloured(values: np.ndarray, most: float, palette: int) -> np.ndarray:
    """8-bit BGR of values from 0 to ``most``."""
    return cv2.applyColorMap(np.clip(values / most * 255, 0, 255).astype(np.uint8), palette)


def panels(index: int, models: list[str]) -> list[np.ndarray]:
    """One row: picture, truth, then map and error of each model and of SGBM + WLS."""
    rng = np.random.default_rng([HELD_OUT_SEED, 6, index])
    case = dual_stack_of("scene", stack_sample(rng, mixed_bank(HELD_OUT_SEED, 96), *SIZE, 0.1, "rooms"))
    maps = [estimate_disparity(case.left, case.right, load_network(name, "cpu")).disparity for name in models]
    maps.append(wls_filled(case.sharp, case.sharp_right, 100.0).disparity)
    top = float(case.disparity.max()) * 1.05
    picture = (np.clip(case.sharp / np.percentile(case.sharp, 99), 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)[..., ::-1]
    row = [picture, coloured(case.disparity, top, cv2.COLORMAP_TURBO)]
    for found in maps:
        error = np.abs(found - case.disparity)
        bad = np.mean(error[case.known] > 2)
        drawn = coloured(np.where(case.known, error, 0), WORST_PX, cv2.COLORMAP_INFERNO)
        cv2.putText(drawn, f"{error[case.known].mean():.2f} px, {bad:.0%} > 2", (8, 40), 0, 1.1, (255, 255, 255), 2, 16)
        row += [coloured(found, top, cv2.COLORMAP_TURBO), drawn]
    return row


def main() -> None:
    """Draw all rows and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--models", nargs="+", default=[DEFAULT_MODEL, "bdffnet-r16-v1"])
    arguments = parser.parse_args()
    names = [*arguments.models, "SGBM + WLS on sharp pictures"]
    titles = ["left, sharp", "truth", *(text for name in names for text in (name, f"error, 0 to {WORST_PX:.0f} px"))]
    rows = [panels(index, arguments.models) for index in range(SCENES)]
    height, width = SIZE[0] // 2, SIZE[1] // 2
    sheet = np.full((LABEL_PX + SCENES * (height + MARGIN), len(titles) * (width + MARGIN), 3), 255, np.uint8)
    for column, title in enumerate(titles):
        x = column * (width + MARGIN)
        cv2.putText(sheet, title, (x + 2, 15), 0, 0.42, (0, 0, 0), 1, 16)
        for line, row in enumerate(rows):
            y = LABEL_PX + line * (height + MARGIN)
            sheet[y : y + height, x : x + width] = cv2.resize(
                row[column], (width, height), interpolation=cv2.INTER_AREA
            )
    if not cv2.imwrite(str(arguments.output), sheet, [cv2.IMWRITE_JPEG_QUALITY, 88]):
        raise SystemExit(f"{arguments.output}: cannot be written")


if __name__ == "__main__":
    main()
