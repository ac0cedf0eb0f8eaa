"""Builds the scenes that come with the viewer: `python assets/build_scenes.py [NAME ...]`.

Needs numpy and Pillow. The same inputs give the same bytes.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NAMES = ("atrium", "cornell", "arch", "glossy")


def build(name: str, folder: Path) -> Path:
    """Builds one scene.

    Args:
        name: One of `NAMES`.
        folder: Where NAME.glb is written; made if it is missing.

    Returns:
        The path of the file.
    """
    if str(HERE) not in sys.path:
        sys.path.insert(0, str(HERE))
    path = folder / f"{name}.glb"
    importlib.import_module(f"builder.{name}").build().write(path)
    return path


def main() -> None:
    """Reads the command line and builds what it names, or everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which of {', '.join(NAMES)}; all when omitted")
    parser.add_argument("--output", type=Path, default=HERE / "scenes", help="folder to write to")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(NAMES)
    if unknown:
        parser.error(f"no such scene: {', '.join(sorted(unknown))}")
    for name in arguments.names or NAMES:
        path = build(name, arguments.output)
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
