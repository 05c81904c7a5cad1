"""A training recipe: one stage, its data, its length."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lfstereo.network.families import AnyArchitecture, read_architecture
from lfstereo.options import from_mapping, option, read_toml


@dataclass(frozen=True, slots=True)
class Recipe:
    """What one training run does; a TOML file holds it, with an ``[architecture]`` table for the network."""

    stage: Literal[
        "pool",
        "stereo",
        "edof",
        "focus_planes",
        "focus",
        "guided",
        "stereo_stacks",
        "fusion",
        "joint",
        "match",
        "slices",
        "fronts",
        "refine",
    ] = option(
        "stereo",
        "what is trained; 'pool' renders the stacks that other stages read, 'fronts' what 'refine' starts from",
    )
    seed: int = option(1, "decides scenes, order and initial weights")
    steps: int = option(100000, "most steps; a limit in minutes may end the run earlier")
    batch: int = option(4, "samples per step")
    rate: float = option(1e-3, "highest learning rate of the one-cycle schedule")
    weight_decay: float = option(1e-4, "of AdamW")
    height: int = option(192, "of a sample", "px")
    width: int = option(320, "of a sample", "px")
    textures: int = option(96, "textures in the bank at any time")
    scenes: Literal["layers", "rooms", "mixed"] = option(
        "layers", "what is rendered: layers before a background, furnished rooms, or both"
    )
    atlas: str = option("", "folder of photographs from which some textures of rooms are cut")
    pool: str = option("", "folder of rendered stack pairs, for the stages that learn from stacks")
    fronts: str = option("", "folder that the stage 'fronts' filled, for the stage 'refine'")
    pool_size: int = option(600, "stack pairs in the pool")
    source: Literal["auto", "pool", "ring"] = option(
        "auto", "samples from a pool on disk, or from a ring on the training device; auto: a ring on a graphics card"
    )
    ring: int = option(512, "stack pairs that a ring holds")
    fresh: float = option(0.5, "stack pairs of a ring that are replaced at each step")
    precision: Literal["auto", "float32", "bfloat16"] = option(
        "auto", "of the network in training; auto: bfloat16 on a graphics card"
    )
    start_from: tuple[str, ...] = option((), "'PART=FOLDER' takes a part's weights from an earlier run's folder")
    crop: tuple[int, int] | None = option(None, "height and width cut from each sample of the pool", "px")
    save_every: float = option(120.0, "time between checkpoints", "s")
    threads: int = option(2, "processor threads")


def read_recipe(path: Path) -> tuple[Recipe, AnyArchitecture]:
    """Read a recipe file.

    Raises
    ------
    ConfigError
        If the file cannot be read, an option is unknown, or a value does not fit.
    """
    table = read_toml(path)
    architecture = read_architecture(table.pop("architecture", {}), f"{path} [architecture]")
    return from_mapping(Recipe, table, str(path)), architecture
