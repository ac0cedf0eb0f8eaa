"""`ssil-viewer scenes`: what can be opened without a file."""

from __future__ import annotations

import argparse

from ssil_viewer.commands.parser import Parser

USAGE = "[flags]"
EPILOG = ""


def add_flags(parser: Parser) -> None:
    """What the command takes: nothing of its own."""


def run(args: argparse.Namespace) -> None:
    """Lists the built-in scenes."""
    from ssil_viewer.scene import BUILTIN_SCENES

    width = max(len(name) for name in BUILTIN_SCENES)
    for name, text in BUILTIN_SCENES.items():
        print(f"builtin:{name:<{width}}  {text}")
