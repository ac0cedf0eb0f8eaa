"""`ssil-viewer view`: the window."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING

from ssil_viewer.commands import shared, values
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.app.exposure_choice import ExposureOrigin

USAGE = "[SCENE] [flags]"
EPILOG = "The keys and the mouse are explained in the window: press F1."


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, "builtin:atrium")
    group = parser.add_argument_group("comparing")
    group.add_argument("--reference", choices=("R1", "R2"), help="compare with the sum over all pixels, or with its "
                       "part that rays see, which converges in the window (R)")
    group.add_argument("--settings-b", metavar="NAME|FILE", help="settings B, shown right of a divider: a preset or a "
                       "TOML file (Ctrl+B)")
    window = parser.add_argument_group("window")
    window.add_argument("--image-scale", type=values.whole("--image-scale", 10, 200), default=100, metavar="PERCENT",
                        help="rendered pixels per pixel of the window, a side; less is faster, 200 smooths edges "
                        "(10 to 200)")
    window.add_argument("--panel-scale", type=values.whole("--panel-scale", 75, 300), default=100, metavar="PERCENT",
                        help="size of text and panels, on top of what the monitor asks for (75 to 300)")
    window.add_argument("--auto-exposure", action="store_true", help="choose the exposure from the first picture, as M "
                        "does; otherwise only if the picture would be nearly black or white")
    add_image_flags(parser, "close the window after this many frames; default: when you close it", as_picture=False)


def run(args: argparse.Namespace) -> None:
    """Opens the window and returns when it is closed."""
    settings = shared.settings_of(args)
    if args.auto_exposure and hasattr(args, "exposure"):
        raise UserError("the window cannot both choose an exposure and be given one", "--auto-exposure and --exposure",
                        "give one of them")
    other = shared.preset_or_file(args.settings_b) if args.settings_b is not None else None
    scene = shared.load(args, [settings])
    camera = shared.camera_of(args, scene)
    check_display()

    try:
        from ssil_viewer.app.recent_scenes import RecentScenes
        from ssil_viewer.app.window import run_window
    except ImportError as error:    # of a library of the system that some package loads
        raise UserError("the window needs a library that is missing", str(error),
                        "on Debian and Ubuntu install libgl1, libx11-6 and libxext6") from error

    run_window(scene=scene, camera=camera if shared.camera_is_given(args) else None, settings=settings,
               size=args.size, frames=args.frames,
               reference=args.reference or "off", other=other, image_scale=args.image_scale / 100,
               panel_scale=args.panel_scale / 100, auto_exposure=args.auto_exposure,
               # A run of so many frames is a script's
               recent=RecentScenes.of_user() if args.frames is None else None,
               exposure_is=_exposure_is(args, settings))


def _exposure_is(args: argparse.Namespace, settings: Settings) -> ExposureOrigin:
    if hasattr(args, "exposure"):
        return "chosen"
    if args.picture is not None:
        return "of picture"
    return "unchosen" if settings.exposure == Settings().exposure else "chosen"


def check_display() -> None:
    """Raises UserError where no window can be opened."""
    if sys.platform.startswith(("win", "darwin", "cygwin")):
        return
    if not os.environ.get("DISPLAY"):
        only_wayland = os.environ.get("WAYLAND_DISPLAY")
        raise UserError("there is no display to open a window on", "DISPLAY is not set",
                        "start Xwayland, which Wayland shows X windows by" if only_wayland else
                        "use ssil-viewer render SCENE -o image.png, or start it with xvfb-run")
