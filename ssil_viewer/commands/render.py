"""`ssil-viewer render`: a scene to a file, without a window."""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ssil_viewer import __version__, output
from ssil_viewer.commands import shared
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.pipeline import Renderer

FORMATS = (".png", ".exr", ".npz")
# Frames after which the running mean of the temporal filter has taken most of the noise out.
TEMPORAL_FRAMES = 16
# Buffers that an EXR holds beside the image, where they exist.
_EXR_LAYERS = ("direct", "indirect", "radiance", "albedo", "normal", "view_depth")

USAGE = "[SCENE] -o FILE [flags]"
EPILOG = """\
formats:
  .png  8-bit sRGB; settings and camera are stored in it as JSON
  .exr  linear 32-bit float: the final image, and the main buffers as layers
  .npz  every named buffer as a float32 array, row 0 = top"""


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, "builtin:atrium")
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="a file that ends in .png, .exr or .npz")
    parser.add_argument("--view", metavar="NAME[@LEVEL]", help="write this buffer, at this mip level, as the image")
    parser.add_argument("--timings", action="store_true", help="print the time of each pass")
    add_image_flags(
        parser,
        f"frames rendered before the result is taken; default {TEMPORAL_FRAMES}, or 1 without the temporal filter",
    )


def run(args: argparse.Namespace) -> None:
    """Renders and writes the file."""
    target = output.check_target(args.output, FORMATS)
    settings = shared.settings_of(args)
    scene = shared.load(args.scene)
    camera = shared.camera_of(args, scene)
    frames = args.frames or (TEMPORAL_FRAMES if settings.temporal else 1)

    from ssil_viewer.gpu.context import create_headless_context
    from ssil_viewer.pipeline import Renderer

    context = create_headless_context()
    try:
        renderer = Renderer(context, args.size, settings)
        try:
            view = _parse_view(args.view, renderer) if args.view else None
            renderer.set_scene(scene)
            if view and target.suffix.lower() == ".png":
                renderer.show_buffer(*view)
            _render_frames(renderer, camera, frames)
            _write(target, renderer, view, _metadata(scene, settings, camera, args, frames))
            if args.timings:
                print_timings(renderer)
        finally:
            renderer.release()
    finally:
        context.release()


def _parse_view(text: str, renderer: Renderer) -> tuple[str, int]:
    buffers = renderer.buffers()
    name, at, level_text = text.partition("@")
    if name not in buffers:
        near = difflib.get_close_matches(name, buffers, 1)
        hint = f"did you mean {near[0]}?" if near else "choose " + ", ".join(buffers)
        raise UserError(f"no buffer is called {name!r}", "--view", hint)
    levels = buffers[name].levels
    if not at:
        return name, levels[0]
    if not re.fullmatch(r"[0-9]{1,2}", level_text) or int(level_text) not in levels:
        span = f"level {levels[0]}" if len(levels) == 1 else f"levels {levels[0]} to {levels[-1]}"
        raise UserError(f"{name} has no level {level_text!r}", "--view", f"it has {span}")
    return name, int(level_text)


def _render_frames(renderer: Renderer, camera: Camera, frames: int) -> None:
    if frames == 1 or sys.stderr is None or not sys.stderr.isatty():
        for _ in range(frames):
            renderer.render(camera)
        return
    from rich.console import Console
    from rich.progress import track

    for _ in track(range(frames), "rendering", console=Console(stderr=True), transient=True):
        renderer.render(camera)


def _write(target: Path, renderer: Renderer, view: tuple[str, int] | None, metadata: Mapping[str, Any]) -> None:
    suffix = target.suffix.lower()
    if suffix == ".png":
        output.write_png(target, _display(renderer), metadata)
    elif suffix == ".npz":
        if view:
            arrays = {view[0]: renderer.read(*view)}
        else:
            arrays = {name: renderer.read(name, info.levels[0]) for name, info in renderer.buffers().items()}
        output.write_npz(target, arrays)
    else:
        if view:
            layers = {"": renderer.read(*view)}
        else:
            layers = {"": renderer.read("final")}
            layers |= {name: renderer.read(name) for name in _EXR_LAYERS if name in renderer.buffers()}
            full = layers[""].shape[:2]
            layers = {name: values for name, values in layers.items() if values.shape[:2] == full}
        output.write_exr(target, layers, metadata)


def _display(renderer: Renderer) -> np.ndarray:
    width, height = renderer.size
    pixels = np.frombuffer(renderer.display.read(), np.uint8).reshape(height, width, 4)
    return pixels[::-1, :, :3]


def _metadata(
    scene: Scene, settings: Settings, camera: Camera, args: argparse.Namespace, frames: int
) -> dict[str, Any]:
    return {
        "version": __version__,
        "scene": scene.name,
        "size": list(args.size),
        "frames": frames,
        "settings": dataclasses.asdict(settings),
        "camera": dataclasses.asdict(camera),
    }


def print_timings(renderer: Renderer) -> None:
    """Prints the time of each pass on standard output."""
    from rich.console import Console
    from rich.table import Table

    timings = renderer.timings
    clock = "GPU timer queries" if timings.source == "gpu" else "wall clock, since this OpenGL renders in software"
    table = Table(title=f"{renderer.capabilities.renderer}, {clock}", title_justify="left")
    table.add_column("pass")
    for column in ("median ms", "p10 ms", "p90 ms"):
        table.add_column(column, justify="right")
    rows = [*timings.passes.items(), ("frame", timings.frame)]
    for index, (name, time) in enumerate(rows):
        if index == len(rows) - 1:
            table.add_section()
        table.add_row(name, *(f"{value:.2f}" for value in (time.median_ms, time.p10_ms, time.p90_ms)))
    Console(soft_wrap=True).print(table)
