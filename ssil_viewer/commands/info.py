"""`ssil-viewer info`: what was loaded, and what was not."""

from __future__ import annotations

import argparse
import json
import sys

from ssil_viewer import output
from ssil_viewer.commands import shared
from ssil_viewer.commands.parser import Parser, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.scene.warning_list import printable

USAGE = "SCENE [flags]"
EPILOG = ""
_SIZE = (1280, 720)


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser)
    parser.add_argument("--json", metavar="FILE", help="write the same as JSON to a file, or - for standard output")


def run(args: argparse.Namespace) -> None:
    """Prints the description, or writes it as JSON."""
    target = None
    if args.json not in (None, "-"):
        # Without its FILE the flag would take the scene that follows it, and write over it
        target = output.check_target(args.json, (".json",))

    from ssil_viewer.scene import describe, format_description

    description = describe(shared.load_described(args))
    targets = _target_bytes()
    if args.json is None:
        print(format_description(description))
        if isinstance(targets, str):
            print(f"  render targets: not known ({printable(targets, 400)})")
        else:
            total = sum(targets.values())
            per_pixel = total / (_SIZE[0] * _SIZE[1])
            print(f"  on the GPU  {per_pixel:.0f} bytes per pixel of render targets,"
                  f" {total / 1e6:.0f} MB at {_SIZE[0]}x{_SIZE[1]} with default settings")
        return
    if isinstance(targets, str):
        print(f"ssil-viewer: warning: render targets: not known ({printable(targets, 400)})", file=sys.stderr)
    else:
        description["render_targets"] = {"size": list(_SIZE), "bytes": targets}
    text = json.dumps(description, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if target is None:
        print(text, end="")
    else:
        output.write_text(target, text)


def _target_bytes() -> dict[str, int] | str:
    """Bytes of each render target, or the reason why there is no OpenGL to ask."""
    try:
        from ssil_viewer.gpu.context import create_headless_context
        from ssil_viewer.pipeline import Renderer

        context = create_headless_context()
        try:
            renderer = Renderer(context, _SIZE)
            try:
                return renderer.target_bytes()
            finally:
                renderer.release()
        finally:
            context.release()
    except UserError as error:  # the scene can be described without OpenGL
        return str(error)
