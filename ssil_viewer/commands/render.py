"""`ssil-viewer render`: a scene to a file, without a window."""

from __future__ import annotations

import argparse
import dataclasses
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ssil_viewer import __version__, output
from ssil_viewer.buffers import BUFFERS, find_buffer
from ssil_viewer.commands import shared
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.scene.light_file import light_tables
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings, knobs

if TYPE_CHECKING:
    from ssil_viewer.pipeline import Renderer

FORMATS = (".png", ".exr", ".npz")
# Frames after which the running mean of the temporal filter has taken most of the noise out.
TEMPORAL_FRAMES = 16
# A buffer that is read back: as four floats by OpenGL, again as bytes, and as the array.
_READ_BACK_BYTES = 48
# Buffers that an EXR holds beside the image, where they exist.
_EXR_LAYERS = ("direct", "indirect", "radiance", "albedo", "normal", "view_depth")

USAGE = "[SCENE] -o FILE [flags]"
EPILOG = """\
formats:
  .png  8-bit sRGB; settings, camera and lights are stored in it as JSON
  .exr  linear 32-bit float: the final image, and the main buffers as layers
  .npz  every buffer that the settings make as a float32 array, row 0 = top

The buffer indirect is irradiance times the material's occlusion map; final = direct + albedo / pi * indirect."""


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, "builtin:atrium")
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="a file that ends in .png, .exr or .npz")
    parser.add_argument("--view", metavar="NAME[@LEVEL]", help="write this buffer, at this mip level, as the image")
    parser.add_argument("--auto-exposure", action="store_true", help="choose the exposure of a .png from the picture; "
                        "--exposure is added to it")
    parser.add_argument("--timings", action="store_true", help="print the time of each pass")
    add_image_flags(
        parser,
        f"frames rendered before the result is taken; default {TEMPORAL_FRAMES}, or 1 without the temporal filter",
    )


def run(args: argparse.Namespace) -> None:
    """Renders and writes the file."""
    target = output.check_target(args.output, FORMATS)
    view = _parse_view(args.view) if args.view is not None else None
    if args.auto_exposure and (view or target.suffix.lower() != ".png"):
        raise UserError("only the picture in a .png has an exposure", "--auto-exposure", "write a .png without --view")
    settings = shared.settings_of(args)
    output.check_writable(target)
    frames = args.frames or (TEMPORAL_FRAMES if settings.temporal or args.timings else 1)

    from ssil_viewer.compile_ahead import compiling_ahead
    from ssil_viewer.gpu.context import create_headless_context, read_capabilities
    from ssil_viewer.headless import KEEP
    from ssil_viewer.pipeline import Renderer

    context = create_headless_context()
    try:
        with compiling_ahead(read_capabilities(context), args.size, settings, keep=KEEP) as tell_scene:
            renderer = Renderer(context, args.size, settings, keep=KEEP)
            try:
                _check_memory(renderer)
                view = _check_view(view, renderer, args) if view else None
                scene = shared.load(args, [settings])
                tell_scene(scene)
                camera = shared.camera_of(args, scene)
                renderer.set_scene(scene)
                if view:
                    _check_view(view, renderer, args, scene)
                if view and target.suffix.lower() == ".png":
                    renderer.show_buffer(*view)
                renderer.timers.waits |= args.timings
                _render_frames(renderer, camera, frames - 1 if args.auto_exposure else frames)
                exposed = ""
                if args.auto_exposure:
                    settings = _expose(renderer, camera, getattr(args, "exposure", 0.0), first=frames == 1)
                    exposed = f", exposure {settings.exposure:+g} EV"
                shared.warn(renderer.warnings)
                _write(target, renderer, view, _metadata(scene, settings, camera, args, frames))
                print(f"wrote {args.output} ({args.size[0]}x{args.size[1]}, {frames} frame{'s' if frames > 1 else ''}"
                      f"{exposed})")
                # Somebody may have chosen it, and indirect light alone is dark as a rule
                plain = settings.exposure == Settings().exposure and settings.show == "both"
                if target.suffix.lower() == ".png" and plain and not (view or hasattr(args, "exposure")):
                    _warn_of_exposure(renderer)
                if args.timings:
                    print_timings(renderer)
            finally:
                renderer.release()
    finally:
        context.release()


def _check_memory(renderer: Renderer) -> None:
    """Refuses an image that could be rendered, but not read back: buffers come to main memory one by one.

    Raises:
        UserError: There is less memory than that takes, with the render targets where OpenGL uses main memory.
    """
    from ssil_viewer.gpu.memory import require_memory

    width, height = renderer.size
    # Software OpenGL has promised the targets their memory, but not taken it before it draws.
    targets = sum(renderer.target_bytes().values()) if renderer.capabilities.software else 0
    require_memory(targets + _READ_BACK_BYTES * width * height, f"an image of {width}x{height}", "--size",
                   "give a smaller one")


def _parse_view(text: str) -> tuple[str, int | None]:
    """Name and level of NAME or NAME@LEVEL."""
    name, at, level = text.partition("@")
    if not name or (at and not re.fullmatch(r"[0-9]{1,2}", level)):
        raise UserError(f"cannot use {text!r} as a view", "--view", "give a buffer such as normal or radiance@3")
    return name, int(level) if at else None


def _check_view(view: tuple[str, int | None], renderer: Renderer, args: argparse.Namespace,
                scene: Scene | None = None) -> tuple[str, int]:
    """The view with its level, the finest where none was asked for.

    Args:
        scene: The renderer's, or None before it has one, which may take long: then it may have glossy
            materials and surfaces.

    Raises:
        UserError: The frame has no such buffer; says what makes it.
    """
    from ssil_viewer.buffer_advice import what_makes
    from ssil_viewer.buffer_views import buffers_of
    from ssil_viewer.passes.rays import RAYS
    from ssil_viewer.passes.sky import ENVIRONMENT

    plan = renderer.runner.plan
    if scene is None:
        brought = ENVIRONMENT if args.environment is not None else frozenset()
        plan = dataclasses.replace(plan, features=plan.features | RAYS | brought)
    buffers = buffers_of(plan)
    name, level = view
    if name in BUFFERS and name not in buffers:
        if changes := what_makes(name, plan, renderer.settings, scene):
            raise UserError(f"{name!r} is not made under these settings", "--view", f"add {_flags(changes)}")
        if scene is not None:
            raise UserError(f"{name!r} is not made for this scene", "--view", "it has nothing that this would show")
    if level is None:
        level = buffers[name].levels.start if name in buffers else 0
    find_buffer(buffers, name, level, "--view")
    return name, level


def _flags(changes: Mapping[str, Any]) -> str:
    """Changes as of `what_makes`, as they are typed."""
    flags = {info.name: info.flag for info in knobs()}
    words = []
    for name, value in changes.items():
        if name == "environment":
            words.append("--environment FILE")
        elif isinstance(value, bool):
            words.append(flags[name] if value else "--no-" + flags[name].removeprefix("--"))
        else:
            words.append(f"{flags[name]} {value}")
    return " ".join(words)


def _render_frames(renderer: Renderer, camera: Camera, frames: int) -> None:
    from ssil_viewer.headless import render_frames

    if frames == 1 or sys.stderr is None or not sys.stderr.isatty():
        render_frames(renderer, camera, frames)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("rendering", total=frames)
        render_frames(renderer, camera, frames, lambda done: progress.update(task, completed=done))


def _expose(renderer: Renderer, camera: Camera, more: float, first: bool) -> Settings:
    """Renders the last frame with the exposure that those before it ask for; the same picture as with `--exposure`.

    Args:
        more: EV that are added to it.
        first: There is no frame before.

    Returns:
        The settings with that exposure; as they were where nothing shines.
    """
    from ssil_viewer.metering import limited, meter

    if first:
        renderer.render(camera)
    metered, settings = meter(renderer), renderer.settings
    if metered is not None:
        settings = settings.replaced({"exposure": limited(round(metered + more, 3))})     # 0.3, not 0.1 + 0.2
    renderer.set_settings(settings)
    if first:
        renderer.reset_history()
    renderer.render(camera)
    return settings


def _warn_of_exposure(renderer: Renderer) -> None:
    """Tells of a picture that is nearly black or white."""
    from ssil_viewer.metering import FAR_OFF, meter

    metered = meter(renderer)
    if metered is None:
        shared.warn(["the picture is black: nothing in it is lit"])
    change = metered - renderer.settings.exposure if metered is not None else 0.0
    if abs(change) >= FAR_OFF:
        kind = "dark" if change > 0 else "bright"
        shared.warn([f"the picture is very {kind}: --auto-exposure would change it by {change:+.1f} EV"])


def _write(target: Path, renderer: Renderer, view: tuple[str, int] | None, metadata: Mapping[str, Any]) -> None:
    from ssil_viewer.headless import read_buffers, read_display

    match target.suffix.lower():
        case ".png":
            output.write_png(target, read_display(renderer), metadata)
        case ".npz" if view:
            output.write_npz(target, {view[0]: renderer.read(*view)})
        case ".npz":
            output.write_npz(target, read_buffers(renderer))
        case ".exr" if view:
            output.write_exr(target, {"": renderer.read(*view)}, metadata)
        case ".exr":
            found = renderer.buffers()
            layers = {name: renderer.read(name) for name in _EXR_LAYERS if name in found}
            output.write_exr(target, {"": renderer.read("final"), **layers}, metadata)


def _metadata(
    scene: Scene, settings: Settings, camera: Camera, args: argparse.Namespace, frames: int
) -> dict[str, Any]:
    return {
        "version": __version__,
        "scene": scene.name,
        "environment": scene.environment.name if scene.environment else "",
        "size": list(args.size),
        "frames": frames,
        "settings": dataclasses.asdict(settings),
        "camera": dataclasses.asdict(camera),
        "lights": light_tables(scene.lights),
    }


def print_timings(renderer: Renderer) -> None:
    """Prints the time of each pass on standard output."""
    from rich.console import Console
    from rich.table import Table

    renderer.timers.drain()
    timings = renderer.timings
    clock = "GPU timer queries" if timings.source == "gpu" else "wall clock, since this OpenGL renders in software"
    table = Table(title=f"{renderer.capabilities.renderer}, {clock}", title_justify="left")
    table.add_column("pass")
    for column in ("median ms", "p10 ms", "p90 ms"):
        table.add_column(column, justify="right")
    rows = [*timings.passes.items(), ("whole frame, wall clock", timings.frame)]
    for index, (name, time) in enumerate(rows):
        if index == len(rows) - 1:
            table.add_section()
        numbers = (time.median_ms, time.p10_ms, time.p90_ms)
        table.add_row(name, *(f"{value:.2f}" if time.count else "-" for value in numbers))
    console = Console(soft_wrap=True)
    console.print(table)
    if not timings.frame.count:
        console.print(f"Nothing was measured: the first frames do not count. Use --frames {TEMPORAL_FRAMES} or more.")
