"""`ssil-viewer info`: what was loaded, and what was not."""

from __future__ import annotations

import argparse

from ssil_viewer.commands.parser import Parser, add_scene

USAGE = "SCENE [flags]"
EPILOG = ""


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser)
    parser.add_argument("--json", metavar="FILE", help="write the same as JSON to a file, or - for standard output")


def run(args: argparse.Namespace) -> None:
    """Prints the description, or writes it as JSON."""
