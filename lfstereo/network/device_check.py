"""What torch finds of a graphics card."""

from __future__ import annotations

import torch


def graphics_card() -> str:
    """Return name and memory of the card that ``--device auto`` takes; empty where torch finds none."""
    if not torch.cuda.is_available():
        return ""
    card = torch.cuda.get_device_properties(0)
    return f"{card.name}, {card.total_memory / 2**30:.0f} GiB, CUDA {torch.version.cuda}"
