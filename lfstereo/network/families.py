"""The families of networks: what describes one, and what builds it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from lfstereo.errors import ConfigError
from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.network.binocular_net import BinocularArchitecture, BinocularNet
from lfstereo.options import from_mapping

AnyArchitecture = Architecture | BinocularArchitecture
AnyNetwork = BdffNet | BinocularNet
WIDEST = 256
"""Most channels or slices that an architecture may name; the published networks have 64."""


def read_architecture(table: Any, where: str) -> AnyArchitecture:
    """Read an ``[architecture]`` table; one that names no family describes the published networks.

    Raises
    ------
    ConfigError
        If an entry is unknown, a value does not fit, or a width is below 1 or above 256.
    """
    own = isinstance(table, dict) and table.get("family") == "binocular"
    found: AnyArchitecture
    found = from_mapping(BinocularArchitecture, table, where) if own else from_mapping(Architecture, table, where)
    for field in fields(found):
        value = getattr(found, field.name)
        if type(value) is int and not 1 <= value <= WIDEST:
            raise ConfigError(f"{where}: found {field.name} = {value}, expected 1 to {WIDEST}")
    return found


def build(architecture: AnyArchitecture) -> AnyNetwork:
    """Make the network that is described, with new weights."""
    if isinstance(architecture, BinocularArchitecture):
        return BinocularNet(architecture)
    return BdffNet(architecture)
