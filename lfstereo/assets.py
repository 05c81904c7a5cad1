"""Find the data that travels with the package: ``calib/`` and ``models/``.

In a wheel both lie in ``lfstereo/_assets``; in a checkout they lie beside the package.
"""

from __future__ import annotations

from pathlib import Path

from lfstereo.errors import AssetError

_PACKAGE = Path(__file__).resolve().parent


def asset_folder(kind: str) -> Path:
    """Return the folder of one kind of asset.

    Parameters
    ----------
    kind
        ``"calib"`` or ``"models"``.

    Raises
    ------
    AssetError
        If the folder is in neither place.
    """
    for folder in (_PACKAGE / "_assets" / kind, _PACKAGE.parent / kind):
        if folder.is_dir():
            return folder
    raise AssetError(f"{_PACKAGE}: the folder '{kind}' is missing from this installation; install lfstereo again")
