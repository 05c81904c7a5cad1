"""Where models lie: shipped ones by name, any other by path. Needs no torch."""

from __future__ import annotations

from pathlib import Path

from lfstereo.assets import asset_folder
from lfstereo.errors import AssetError

CARD = "card.toml"
WEIGHTS = "weights.safetensors"
DEFAULT_MODEL = "binocular-v3"
"""The model used where none is named."""


def find_model(name: str | Path) -> Path:
    """Return the folder of a model: a shipped one by name, any other by path.

    Raises
    ------
    AssetError
        If there is neither.
    """
    shipped = asset_folder("models")
    for folder in (shipped / name, Path(name)):
        if (folder / CARD).is_file():
            return folder
    known = sorted(card.parent.name for card in shipped.glob(f"*/{CARD}"))
    raise AssetError(f"model '{name}': neither a shipped model nor a folder with {CARD}; shipped are {known}")
