"""``lfstereo synthesize``: a dual focal stack data set from stereo pictures of known disparity."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from contextlib import nullcontext
from pathlib import Path

from lfstereo.cli.evaluate import picture_size
from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments
from lfstereo.progress import progress_bar, silent
from lfstereo.simulate.photograph import PhotographOptions
from lfstereo.simulate.stereo_scenes import SceneFiles, find_scenes
from lfstereo.simulate.synthesis import SplitOptions, synthesize
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("folders", nargs="*", type=Path, help="Middlebury scenes, folders of them, or FlyingThings3D")
    parser.add_argument(
        "--pair",
        nargs=3,
        type=Path,
        action="append",
        default=[],
        metavar=("LEFT", "RIGHT", "DISPARITY"),
        help="pictures of your own and the left view's disparity (PFM, or PNG with --disparity-scale); repeatable",
    )
    parser.add_argument("--generated", metavar="HxW", help="render scenes of this size instead; --train, --test many")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the data set; a begun one goes on")
    parser.add_argument("--disparity-scale", type=float, help="what grey-coded disparities are divided by")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    for title, options in (
        ("virtual camera", PhotographOptions),
        ("its lens and sensor", VirtualDslrOptions),
        ("split", SplitOptions),
    ):
        add_arguments(parser.add_argument_group(title), options)  # type: ignore[arg-type]


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    options = from_arguments(PhotographOptions, arguments)
    dslr, split = from_arguments(VirtualDslrOptions, arguments), from_arguments(SplitOptions, arguments)
    if bool(arguments.generated) == bool(arguments.folders or arguments.pair):
        raise ConfigError("scenes: give folders of scenes or --pair LEFT RIGHT DISPARITY, or else --generated HxW")
    size = picture_size("--generated", arguments.generated) if arguments.generated else (0, 0)
    scenes = [] if arguments.generated else _scenes(arguments)
    with nullcontext(silent) if arguments.json else progress_bar("synthesize") as progress:
        if arguments.generated:
            from lfstereo.training.generated_dataset import generate

            found = generate(arguments.output, size, split, options, dslr, progress)
        else:
            found = synthesize(arguments.output, scenes, options, dslr, split, progress)
    if arguments.json:
        summary = {"written": found.written, "kept": found.kept, "too_near": found.too_near}
        print(json.dumps({"output": str(arguments.output)} | summary, indent=2))
    else:
        print(
            f"{arguments.output}: {len(found.written)} scenes of {options.slices} slices per view written, "
            f"{len(found.kept)} were there, {len(found.too_near)} left out as too near"
        )
    return 0


def _scenes(arguments: argparse.Namespace) -> list[SceneFiles]:
    scale = arguments.disparity_scale
    scenes = [scene for folder in arguments.folders for scene in find_scenes(folder, scale)]
    scenes += [SceneFiles(left.stem, left, right, truth, scale=scale) for left, right, truth in arguments.pair]
    counts = Counter(scene.name for scene in scenes)
    if twice := sorted(name for name, count in counts.items() if count > 1):
        raise ConfigError(f"scenes: {', '.join(twice[:5])} found more than once; rename their files or folders")
    return scenes
