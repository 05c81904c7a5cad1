"""The families of networks: what describes one, and what builds it."""

from __future__ import annotations

from typing import Any

from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.network.binocular_net import BinocularArchitecture, BinocularNet
from lfstereo.options import from_mapping

AnyArchitecture = Architecture | BinocularArchitecture
AnyNetwork = BdffNet | BinocularNet


def read_architecture(table: Any, where: str) -> AnyArchitecture:
    """Read an ``[architecture]`` table; one that names no family describes the published networks.

    Raises
    ------
    ConfigError
        If an entry is unknown or a value does not fit.
    """
    if isinstance(table, dict) and table.get("family") == "binocular":
        return from_mapping(BinocularArchitecture, table, where)
    return from_mapping(Architecture, table, where)


def build(architecture: AnyArchitecture) -> AnyNetwork:
    """Make the network that is described, with new weights."""
    if isinstance(architecture, BinocularArchitecture):
        return BinocularNet(architecture)
    return BdffNet(architecture)
