"""A simulated session on disk, as if copied from the two cameras, with the truth beside it."""

from __future__ import annotations

import struct
from pathlib import Path

from lfstereo.container import write_capture
from lfstereo.options import to_toml, toml_value
from lfstereo.outputs import atomic_folder
from lfstereo.progress import Progress, silent
from lfstereo.rig.geometry import Side
from lfstereo.rig.rig import write_rig
from lfstereo.rig.target import write_target
from lfstereo.simulate.boards import BoardPose, board_scene, board_target, draw_poses
from lfstereo.simulate.capture import take_picture, take_white_image
from lfstereo.simulate.frame_metadata import ZOOM_FOCUS_NUMBER
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig, build_rig
from lfstereo.simulate.room import room
from lfstereo.simulate.scene import Scene
from lfstereo.simulate.sensor import hot_pixels
from lfstereo.simulate.truth import true_maps, write_truth

_SIDES: tuple[Side, Side] = ("left", "right")


def write_simulation(
    folder: Path, options: SimulateOptions, force: bool = False, progress: Progress = silent
) -> SimulatedRig:
    """Simulate a session and write it: captures, white images, rig, truth, calibration shots; whole or not at all.

    The folder gets ``left.LFR``, ``right.LFR``, ``whites/<serial>/MOD_0015.RAW`` with text file and list of hot pixels,
    ``rig.toml``, ``truth/``, with boards ``boards/NN_left.LFR``, ``NN_right.LFR``, ``target.toml`` for the
    calibration and ``poses.toml`` with the truth, and ``simulation.toml`` with the options.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or cannot be written.
    ConfigError
        If a calibration board does not fit into the views.
    """
    rig = build_rig(options)
    poses = draw_poses(options, rig)
    steps = _Steps(progress, 3 + len(poses))
    with atomic_folder(folder, force) as scratch:
        scene = room(options, rig)
        (scratch / "truth").mkdir()
        write_truth(scratch / "truth", true_maps(scene, rig.stereo))
        for side in _SIDES:
            _write_white(scratch / "whites", rig, side, options)
        steps.next()
        _write_pair(scratch, "", scene, rig, options, 1, steps)
        if poses:
            (scratch / "boards").mkdir()
            (scratch / "boards" / "poses.toml").write_text(_poses_toml(poses), "utf-8")
            write_target(scratch / "boards" / "target.toml", board_target(options))
        for number, pose in enumerate(poses):
            shot = board_scene(pose, options, rig)
            _write_pair(scratch / "boards", f"{number:02d}_", shot, rig, options, 100 + number, steps)
        write_rig(scratch / "rig.toml", rig.stereo)
        (scratch / "simulation.toml").write_text("[simulate]\n" + to_toml(options), "utf-8")
        steps.next()
    return rig


class _Steps:
    """Progress of several pairs as one count."""

    def __init__(self, progress: Progress, parts: int) -> None:
        self.progress, self.parts, self.done = progress, parts, 0

    def next(self) -> None:
        self.done += 1
        self.progress(self.done * 1000, self.parts * 1000)

    def within(self, first: float, share: float) -> Progress:
        def report(done: int, total: int) -> None:
            self.progress(int((self.done + first + share * done / total) * 1000), self.parts * 1000)

        return report


def _write_pair(
    folder: Path,
    prefix: str,
    scene: Scene,
    rig: SimulatedRig,
    options: SimulateOptions,
    frame: int,
    steps: _Steps,
) -> None:
    for number, side in enumerate(_SIDES):
        picture = take_picture(scene, rig, side, options, frame, steps.within(number / 2, 0.5))
        write_capture(folder / f"{prefix}{side}.LFR", picture)
    steps.next()


def _write_white(folder: Path, rig: SimulatedRig, side: Side, options: SimulateOptions) -> None:
    white = take_white_image(rig, side, options)
    place = folder / white.metadata.serial
    place.mkdir(parents=True)
    write_capture(place / f"MOD_{ZOOM_FOCUS_NUMBER:04d}.RAW", white)
    count = options.hot_pixels if options.noise else 0
    places, _ = hot_pixels(white.metadata.serial, (white.metadata.width, white.metadata.height), count)
    # Light Field Toolbox, LFReadHotPixels: uint32 count, all x as uint16, all y as uint16, 0-based.
    (place / "HOTPIXEL.BIN").write_bytes(struct.pack("<I", count) + places.T.astype("<u2").tobytes())


def _poses_toml(poses: list[BoardPose]) -> str:
    lines = [
        "# left_from_board: rotation vector and place of the first inner corner, board x along the rows, y down",
        f"corners = {toml_value(poses[0].corners)}",
        f"square_m = {toml_value(poses[0].square_m)}",
    ]
    for number, pose in enumerate(poses):
        lines += ["", "[[shot]]", f"left = {toml_value(f'{number:02d}_left.LFR')}"]
        lines += [f"right = {toml_value(f'{number:02d}_right.LFR')}"]
        lines += [f"{name} = {toml_value(getattr(pose, name))}" for name in ("rotation_rad", "translation_m")]
    return "\n".join(lines) + "\n"
