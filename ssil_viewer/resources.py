"""Where the files that ship with the program lie: shaders and the built-in scenes.

In a checkout `shaders/` and `assets/` stand at the top of the repository; a wheel carries them inside
the package as `_shaders` and `_assets`.
"""

from __future__ import annotations

from pathlib import Path

from ssil_viewer.errors import UserError

BUILTIN_PREFIX = "builtin:"
"""Of names of what comes with the program, in place of a file."""

_PACKAGE = Path(__file__).resolve().parent


def _root(installed: str, checkout: str) -> Path:
    """The folder inside the package when it is there, else the one at the top of the checkout."""
    packaged = _PACKAGE / installed
    return packaged if packaged.is_dir() else _PACKAGE.parent / checkout


def asset_path(*parts: str) -> Path:
    """The path of a shipped asset, such as `asset_path("scenes", "atrium.glb")`.

    Raises:
        UserError: The file or folder is not there, which means a broken installation.
    """
    return _existing(_root("_assets", "assets").joinpath(*parts))


def shader_path(*parts: str) -> Path:
    """The path of a shader or, without parts, of the folder that holds them all.

    Raises:
        UserError: The file or folder is not there, which means a broken installation.
    """
    return _existing(_root("_shaders", "shaders").joinpath(*parts))


def _existing(path: Path) -> Path:
    if not path.exists():
        raise UserError("a file of the program is missing", str(path), "install ssil-viewer again")
    return path
