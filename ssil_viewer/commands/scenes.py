"""`ssil-viewer scenes`: what there is without a file."""

from __future__ import annotations

import argparse

from ssil_viewer.commands.parser import Parser

USAGE = "[flags]"
EPILOG = ""


def add_flags(parser: Parser) -> None:
    """What the command takes: nothing of its own."""


def run(args: argparse.Namespace) -> None:
    """Lists the built-in scenes, and the skies."""
    from ssil_viewer.resources import BUILTIN_PREFIX
    from ssil_viewer.scene import BUILTIN_SCENES
    from ssil_viewer.scene.builtin_sky import SKIES

    width = max(len(name) for name in (*BUILTIN_SCENES, *SKIES))
    for name, text in BUILTIN_SCENES.items():
        print(f"{BUILTIN_PREFIX}{name:<{width}}  {text}")
    print("\nfor --environment:")
    for name, text in SKIES.items():
        print(f"{BUILTIN_PREFIX}{name:<{width}}  {text}")
