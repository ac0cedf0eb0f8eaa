"""Finds out what a scene file is and has it loaded."""

from __future__ import annotations

import difflib
from pathlib import Path

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.resources import BUILTIN_PREFIX, asset_path
from ssil_viewer.scene.gltf import load_gltf
from ssil_viewer.scene.gltf_document import GLB_MAGIC
from ssil_viewer.scene.lights import with_default_light
from ssil_viewer.scene.model import Scene
from ssil_viewer.scene.obj import load_obj
from ssil_viewer.scene.other import OTHER_FORMATS, load_other

BUILTIN_SCENES = {
    "atrium": "Two storeys of arcades around a sunlit court with coloured hangings: light that bleeds into the shade",
    "cornell": "The Cornell box, lit by a point light under its ceiling: exact direct light, every wall on screen",
    "arch": "A room whose right wall alone is lit, a cube and an arch before it: what visibility has to shade",
    "glossy": "Coloured and glowing objects on a shiny ground",
}
"""Name -> what it shows."""


def load_scene(source: str | Path, default_light: bool = True) -> Scene:
    """Loads a scene.

    Args:
        source: A file, or "builtin:NAME" with a name of `BUILTIN_SCENES`.
        default_light: Add a sun, and a warning, when nothing in the scene shines.

    Returns:
        The scene.

    Raises:
        UserError: The file is missing, of an unknown kind, broken, or without geometry.
    """
    name = str(source)
    path = _builtin_path(name) if name.startswith(BUILTIN_PREFIX) else Path(source)
    # Broken files hold infinities; they are looked for explicitly, so numpy need not remark on them.
    with np.errstate(all="ignore"):
        try:
            scene = _load_file(path, name)
            return with_default_light(scene) if default_light else scene
        except MemoryError as error:
            raise UserError("there is not enough memory for the scene", str(path)) from error


def _builtin_path(name: str) -> Path:
    short = name.removeprefix(BUILTIN_PREFIX)
    if short not in BUILTIN_SCENES:
        near = difflib.get_close_matches(short, BUILTIN_SCENES, 1, 0.5)
        known = " ".join(BUILTIN_PREFIX + known for known in BUILTIN_SCENES)
        raise UserError("there is no such built-in scene", name,
                        f"did you mean {BUILTIN_PREFIX}{near[0]}?" if near else f"give one of {known}")
    return asset_path("scenes", f"{short}.glb")


def _load_file(path: Path, name: str) -> Scene:
    """Dispatches by the first bytes where they tell, else by the extension."""
    try:
        if not path.exists():
            near = difflib.get_close_matches(path.name, BUILTIN_SCENES, 1, 0.7)
            raise UserError("the scene does not exist", str(path),
                            f"did you mean {BUILTIN_PREFIX}{near[0]}?" if near else "check the path")
        if not path.is_file():
            raise UserError("the scene is not a regular file", str(path), "give the scene file itself")
        with path.open("rb") as file:
            start = file.read(len(GLB_MAGIC))
    except OSError as error:
        raise UserError(f"the scene cannot be read ({error.strerror})", str(path)) from error
    except ValueError as error:  # a NUL in the name
        raise UserError("this is not a file name", repr(str(path))) from error
    extension = path.suffix.lower()
    if start == GLB_MAGIC or extension in (".gltf", ".glb"):
        return load_gltf(path, name)
    if extension == ".obj":
        return load_obj(path, name)
    if extension in OTHER_FORMATS:
        return load_other(path, name)
    known = " ".join((".gltf", ".glb", ".obj", *OTHER_FORMATS))
    advice = f"known are {known}"
    if extension == ".png":
        advice = "saved pictures are opened by the window, with Ctrl+O, and taken by the commands"
    raise UserError(f"the file type {extension!r} is not known", str(path), advice)
