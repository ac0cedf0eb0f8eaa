"""What is written and read back: pictures that remember what they show, files of settings and of lights."""

from __future__ import annotations

import dataclasses
import json
import math
from datetime import datetime
from pathlib import Path
from typing import Any, Iterable

import numpy as np

from ssil_viewer import __version__, output
from ssil_viewer.errors import UserError
from ssil_viewer.scene.light_file import light_tables, lights_of, lights_text
from ssil_viewer.scene.model import Camera, Light
from ssil_viewer.settings import Settings, knobs


@dataclasses.dataclass(frozen=True)
class SavedView:
    """What a saved picture shows.

    Attributes:
        scene: Source of the scene, empty when the picture does not say. Of `load_picture`: beside the picture, if the
            file is there alone.
        environment: File of the environment, empty when there is none; None where the picture does not say.
        lights: None where the picture does not say.
    """

    scene: str
    settings: Settings
    camera: Camera
    environment: str | None = None
    lights: tuple[Light, ...] | None = None


def save_picture(folder: Path, rgb: np.ndarray, view: SavedView, details: dict[str, Any]) -> Path:
    """Write a PNG under a new name that begins with the time.

    Args:
        rgb: (H, W, 3) uint8, sRGB-encoded, row 0 = top.
        view: Stored inside, for `load_picture`.
        details: More to store, such as the name of the GPU.

    Raises:
        UserError: The folder cannot be written to.
    """
    camera = dataclasses.asdict(view.camera)
    metadata = details | {"version": __version__, "scene": view.scene, "camera": camera,
                          "settings": dataclasses.asdict(view.settings)}
    if view.environment is not None:
        metadata["environment"] = view.environment
    if view.lights is not None:
        metadata["lights"] = light_tables(view.lights)
    path = output.check_target(_free_name(folder, ".png"), (".png",))
    output.write_png(path, rgb, metadata)
    return path


def load_picture(path: Path) -> SavedView:
    """What a saved PNG shows. Settings it does not know keep their defaults.

    Raises:
        UserError: The file is no picture, or was not written by this program.
    """
    try:
        data = output.read_metadata(path)
    # Pillow raises SyntaxError for broken chunks, json RecursionError
    except (OSError, ValueError, SyntaxError, RecursionError) as error:
        raise UserError("picture cannot be read", str(path), str(error)) from error
    if not isinstance(data, dict) or not {"settings", "camera"} <= data.keys():
        raise UserError("picture holds no settings", str(path), "give one that F12 or ssil-viewer render has written")
    try:
        camera = _read_camera(data["camera"], str(path))
        known = {info.name for info in knobs()}
        values = {name: value for name, value in data["settings"].items() if name in known}
        environment = _beside(data["environment"], path) if "environment" in data else None
        lights = lights_of(data["lights"], str(path)) if "lights" in data else None
        scene = _beside(data.get("scene", ""), path)
        return SavedView(scene, Settings().replaced(values, str(path)), camera, environment,
                         lights)
    except (AttributeError, TypeError, ValueError, OverflowError, OSError) as error:    # OSError: too long a path
        raise UserError("settings in the picture cannot be read", str(path), str(error)) from error


def settings_text(settings: Settings) -> str:
    """A settings file (TOML) with every value that is not the default."""
    default = Settings()
    lines = [f"{info.name} = {_toml(getattr(settings, info.name))}\n" for info in knobs()
             if getattr(settings, info.name) != getattr(default, info.name)]
    return "".join(lines) or "# All settings have their default values.\n"


def save_settings(folder: Path, settings: Settings) -> Path:
    """Write a settings file under a new name that begins with the time. Raises UserError when the folder cannot be
    written to."""
    path = output.check_target(_free_name(folder, ".toml"), (".toml",))
    output.write_text(path, settings_text(settings))
    return path


def save_lights(folder: Path, lights: Iterable[Light]) -> Path:
    """Write a lights file under a new name that has the time. Raises UserError when the folder cannot be written to."""
    path = output.check_target(_free_name(folder, ".toml", "ssil-lights"), (".toml",))
    output.write_text(path, lights_text(lights))
    return path


def _read_camera(stored: dict[str, Any], where: str) -> Camera:
    """The camera of a picture. Raises UserError, or what numbers of a wrong type raise, when it shows nothing."""
    usual = Camera()
    eye, target, up = (_read_vector(stored.get(name, getattr(usual, name))) for name in ("eye", "target", "up"))
    fov, near = float(stored.get("vertical_fov", usual.vertical_fov)), stored.get("near")
    near = None if near is None else float(near)
    with np.errstate(over="ignore"):
        away = float(np.linalg.norm(np.subtract(target, eye)))
    if not (math.isfinite(away) and away > 1e-12 * max(1.0, *map(abs, eye))):
        raise UserError("camera in the picture looks at its own position", where)
    if not 0.0 < fov < math.pi:
        raise UserError("camera in the picture has no field of view between 0 and 180 degrees", where)
    if near is not None and not 0.0 < near < math.inf:
        raise UserError("camera in the picture has a near plane that is not in front of it", where)
    return Camera(str(stored.get("name", "")), eye, target, up, fov, near)


def _read_vector(stored: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in stored)
    if not all(map(math.isfinite, (x, y, z))):
        raise ValueError("a camera needs finite numbers")
    return x, y, z


def _beside(source: str, picture: Path) -> str:
    """A file that the picture names, as it says or, where only that exists, relative to the picture's folder."""
    if not isinstance(source, str):
        raise TypeError("names of scene and environment must be text")
    near = picture.parent / source
    return str(near) if source and not Path(source).exists() and near.exists() else source


def _free_name(folder: Path, ending: str, begin: str = "ssil") -> Path:
    stem = datetime.now().strftime(f"{begin}-%Y%m%d-%H%M%S")
    names = [f"{stem}{ending}", *(f"{stem}-{n}{ending}" for n in range(2, 100))]
    return next((folder / name for name in names if not (folder / name).exists()), folder / names[-1])


def _toml(value: bool | int | float | str) -> str:
    # JSON and TOML write booleans, numbers and plain strings alike.
    return json.dumps(value)
