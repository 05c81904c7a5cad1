"""Put the parts of several training runs together into one model folder with its card.

Run ``python -m lfstereo.training.publish stereo=RUN edof=RUN ... -o models/bdffnet-r16-v1``.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from lfstereo.errors import ConfigError
from lfstereo.network.bdff_net import Architecture, paper_architecture
from lfstereo.network.binocular_net import BinocularArchitecture
from lfstereo.network.card import LICENCE, Metric, ModelCard, Training
from lfstereo.network.families import AnyArchitecture, build
from lfstereo.network.weights import load_model, save_model
from lfstereo.training.checkpoint import FOLDER, Counters, read_weights
from lfstereo.training.evaluate import ABLATIONS, BAD_PX, HELD_OUT_SEED, edof_mae, evaluate, held_out
from lfstereo.training.recipe import read_recipe

DATA = (
    "procedural scenes of slanted and curved textured layers (lfstereo.training.scenes), rendered from seeds; "
    "no photograph, no other data set"
)
DEVIATIONS = (
    "Stereo-Net: siamese features and a volume over 0 to 104 px in place of the concatenated images, half of it "
    "learned group-wise correlation, half fixed normalised cross-correlation of the images; hourglasses at 1/4 of the "
    "resolution, expected bin and a refinement; the concatenation learns no matching in the training time available",
    "Focus-Net: a focus volume (shared weights per slice, expected slice) in place of four branches over the "
    "concatenated slices, for the same reason",
    "EDoF-Net, Focus-Net-Guided, BDfF-Net: convolutions as published, added to the mean slice or the incoming map",
    "BDfF-Net multiplies the probabilities that focus and stereo give each disparity before the map is read out",
    "BDfF-Net's ten convolutions also see the left all-in-focus image and how far each cue can be trusted, and return "
    "a weight between stereo and focus and a correction",
)
LIMITS = (
    "16 slices, evenly spaced, focus disparities within -1 to 104 px",
    "aperture ratio D/B of 0.05 to 0.4 in training, mostly 0.08 to 0.2",
    "trained on a processor for under two hours, on rendered scenes only: expect errors of several px on thin objects, "
    "plain surfaces, reflections, and where the left view sees what the right one does not",
)
BINOCULAR_DATA = "rendered rooms and layers (lfstereo.training.rooms, lfstereo.training.scenes); no evaluation set"
BINOCULAR_LIMITS = (
    "5 to 64 slices in any spacing, disparities from 0 to 256 px; training saw 8 to 31 slices and 0 to 100 px",
    "aperture ratio D/B of 0.05 to 0.4 in training, mostly 0.08 to 0.2",
    "trained on rendered scenes only: expect errors on reflections, glass and large plain surfaces",
)


def publish(
    sources: dict[str, Path],
    folder: Path,
    stages: Sequence[Path],
    device: str,
    architecture: AnyArchitecture = Architecture(),
    force: bool = False,
    data: str = "",
) -> ModelCard:
    """Assemble and write a model.

    Parameters
    ----------
    sources
        Part -> run folder; all of edof, focus, guided, stereo, fusion.
    folder
        Where the model goes; ``<name>-v<N>``.
    stages
        Run folders, in order, for the training story.
    device
        What the training ran on, in words.
    architecture
        Widths and variants that the runs were made with.
    force
        Replace an existing folder.
    data
        What it was trained on, in words; unset: the scenes of the shipped recipes.

    Raises
    ------
    ConfigError
        If a part has no source, or the folder's name has no version.
    """
    network, binocular = build(architecture), isinstance(architecture, BinocularArchitecture)
    parts = [part for part, _ in network.named_children()]
    if missing := [part for part in parts if part not in sources]:
        raise ConfigError(f"publish: no run is given for {missing[0]}, expected {', '.join(parts)}")
    name, dash, version = folder.name.rpartition("-v")
    if not dash or not version.isdigit():
        raise ConfigError(f"{folder}: expected a name such as bdffnet-r16-v1, ending in a version")
    state = network.state_dict()
    for part, run in sources.items():
        state.update({key: value for key, value in read_weights(run).items() if key.startswith(part + ".")})
    network.load_state_dict(state, strict=True)
    counters = [Counters(**json.loads((run / FOLDER / "counters.json").read_text())) for run in stages]
    story = Training(
        data=data or (BINOCULAR_DATA if binocular else DATA),
        device=device,
        minutes=round(sum(c.elapsed_s for c in counters) / 60, 1),
        date=datetime.now(UTC).date().isoformat(),
        stages=tuple(f"{c.stage}: {c.step} steps, {c.elapsed_s / 60:.1f} min" for c in counters),
    )
    deviations = () if binocular or architecture == paper_architecture() else DEVIATIONS
    limits = BINOCULAR_LIMITS if binocular else LIMITS
    card = ModelCard(name, int(version), LICENCE, "", deviations, limits, architecture, story)
    return save_model(folder, network, card, force)


def measure(folder: Path, count: int, height: int = 192, width: int = 320) -> ModelCard:
    """Measure a published model on held-out scenes and write the figures into its card.

    Parameters
    ----------
    folder
        The model.
    count
        Scenes.
    height, width
        Of the scenes, px.
    """
    network, card = load_model(folder)
    samples = held_out(count, height, width, None, HELD_OUT_SEED)
    command = f"python -m lfstereo.training.evaluate {folder.name} --count {count} --height {height} --width {width}"
    where = f"{count} rendered scenes of {width} x {height} px with seeds and textures not used in training"
    metrics: list[Metric] = []
    for row in evaluate(network, samples):
        metrics.append(Metric(f"{row.part}: mean absolute disparity error", round(row.mae_px, 2), "px", where, command))
        if row.part in ("stereo", "fused", ABLATIONS[0]):
            shares = zip(BAD_PX, row.bad, strict=True)
            metrics.extend(
                Metric(f"{row.part}: pixels off by more than {limit:.0f} px", round(100 * bad, 1), "%", where, command)
                for limit, bad in shares
            )
    found, plain = edof_mae(network, samples)
    metrics.append(Metric("edof: mean absolute error of the image", round(found, 4), "of 1.0", where, command))
    metrics.append(Metric("mean slice, for comparison", round(plain, 4), "of 1.0", where, command))
    return save_model(folder, network, dataclasses.replace(card, metrics=tuple(metrics)), force=True)


def main(words: Sequence[str] | None = None) -> int:
    """Assemble a model from the command line."""
    parser = argparse.ArgumentParser(prog="lfstereo.training.publish", description=__doc__)
    parser.add_argument("parts", nargs="+", metavar="PART=RUN", help="where each part's weights come from")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--stages", nargs="*", type=Path, default=[], help="run folders, for the training story")
    parser.add_argument("--device", default="processor")
    parser.add_argument("--recipe", type=Path, help="recipe with the runs' [architecture]; default: the shipped one")
    parser.add_argument("--data", default="", help="what the model was trained on, in words")
    parser.add_argument("--measure", type=int, default=0, metavar="N", help="measure on N held-out scenes for the card")
    parser.add_argument("--force", action="store_true")
    arguments = parser.parse_args(words)
    sources = {part: Path(run) for part, _, run in (text.partition("=") for text in arguments.parts)}
    architecture = read_recipe(arguments.recipe)[1] if arguments.recipe else Architecture()
    publish(
        sources, arguments.output, arguments.stages, arguments.device, architecture, arguments.force, arguments.data
    )
    if arguments.measure:
        measure(arguments.output, arguments.measure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
