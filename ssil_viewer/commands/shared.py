"""What several commands need: settings and camera out of the flags, and a scene with its warnings shown."""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ssil_viewer import output, saved_view
from ssil_viewer.commands import values
from ssil_viewer.errors import UserError
from ssil_viewer.resources import BUILTIN_PREFIX
from ssil_viewer.scene.environment import load_environment
from ssil_viewer.scene.light_file import load_lights, with_lights
from ssil_viewer.scene.lights import SUN_ADDED
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings, knobs, load_preset, load_settings, presets, settings_in

_WARNINGS_SHOWN = 8
_LEVEL_SETTINGS = {"start_level", "levels"}


def settings_of(args: argparse.Namespace) -> Settings:
    """Defaults, then those of a picture, then preset, then settings file, then flags; the later wins.

    Raises:
        UserError: An unknown preset, a bad file, or levels that do not fit the size that was asked for.
    """
    settings = args.picture.settings if args.picture is not None else Settings()
    sources: dict[str, str] = {}  # levels that somebody asked for, and where: "" for flags
    if args.preset is not None:
        settings = _and_sources(load_preset(args.preset, settings), settings, f"--preset {args.preset}", sources)
    if args.settings is not None:
        settings = _and_sources(load_settings(Path(args.settings), settings), settings, args.settings, sources)
    flags = {name: getattr(args, name) for name in flags_given(args)}
    settings = settings.replaced(flags)
    check_fits(args.size, settings, sources | dict.fromkeys(_LEVEL_SETTINGS & flags.keys(), ""))
    return settings


def take_picture(args: argparse.Namespace) -> None:
    """Where SCENE is a saved picture, puts what it shows in its place: `picture`, and its `scene`, `environment` and
    `size`. Without one, the size is the usual one.

    Raises:
        UserError: It is no picture of this program, or its scene is not there.
    """
    source = getattr(args, "scene", None)
    is_picture = bool(source) and Path(source).suffix.lower() == ".png"
    if is_picture:
        args.picture = saved_view.load_picture(Path(source))
    if hasattr(args, "usual_size") and args.size is None:
        args.size = output.read_size(Path(source)) if is_picture and args.size_as_picture else args.usual_size
    if not is_picture:
        return
    args.scene = args.picture.scene
    if not args.scene:
        raise UserError("picture does not say which scene it shows", source)
    if not args.scene.startswith(BUILTIN_PREFIX) and not Path(args.scene).exists():
        raise UserError("the scene that the picture shows is not there", args.scene, "start where it was saved")
    if getattr(args, "environment", "") is None:
        args.environment = args.picture.environment or None


def preset_or_file(name: str) -> Settings:
    """The settings of a shipped preset or, where none has that name, of a file, over the defaults.

    Raises:
        UserError: There is no such preset or file, or it is bad.
    """
    return load_preset(name) if name in presets() else load_settings(Path(name))


def _and_sources(settings: Settings, base: Settings, source: str, sources: dict[str, str]) -> Settings:
    """Notes in `sources` which levels differ from those of `base`; returns `settings`."""
    changed = {name for name in _LEVEL_SETTINGS if getattr(settings, name) != getattr(base, name)}
    sources.update(dict.fromkeys(changed, source))
    return settings


def check_fits(size: tuple[int, int], settings: Settings, explicit: Mapping[str, str]) -> None:
    """Refuses levels that the user asked for and that the image has no room for.

    A level whose texel is twice the image's larger side says nothing that the level before did not. Defaults are
    not held to that: a tiny image simply works.

    Args:
        explicit: Names of the settings that were asked for, with the file or preset, or "" for flags.

    Raises:
        UserError: Names how many levels fit.
    """
    if not _LEVEL_SETTINGS & explicit.keys():
        return
    side = max(size)
    coarsest = (2 * side - 1).bit_length() - 1  # largest L with 2^L < 2 * side
    if settings.last_level <= coarsest:
        return
    image = f"an image of {size[0]}x{size[1]}"
    fitting = coarsest - settings.start_level + 1
    if fitting >= 1:
        advice = f"give at most {fitting} level{'s' if fitting > 1 else ''}, or a larger --size"
        raise UserError(f"{settings.levels} levels from start level {settings.start_level} do not fit {image}",
                        explicit.get("levels") or explicit.get("start_level") or "--levels", advice)
    raise UserError(f"start level {settings.start_level} does not fit {image}",
                    explicit.get("start_level") or explicit.get("levels") or "--start-level",
                    f"give at most {coarsest} with --levels 1, or a larger --size")


def load(args: argparse.Namespace, rows: Sequence[Settings]) -> Scene:
    """Loads the scene with its --lights and its --environment, and prints warnings on standard error: theirs, and of
    flags that have no effect.

    Either of the two says how the scene is lit: then it gets no default sun, except beside a clear sky.

    Args:
        rows: The settings that are going to be used, one after the other.
    """
    from ssil_viewer import idle_settings

    scene = load_described(args)
    advice = "; --environment builtin:sky adds a sky" if args.environment is None else ""
    warn([warning + advice if warning == SUN_ADDED else warning for warning in scene.warnings])
    warn(idle_settings.warnings(flags_given(args), rows, scene))
    return scene


def flags_given(args: argparse.Namespace) -> set[str]:
    """Names of the settings that have been given as flags."""
    return {info.name for info in knobs() if hasattr(args, info.name)}


def names_given(args: argparse.Namespace) -> set[str]:
    """Names of the settings that a flag, the preset or the settings file says, be it the default."""
    files = [presets()[args.preset]] if args.preset is not None else []
    files += [Path(args.settings)] if args.settings is not None else []
    return flags_given(args).union(*(settings_in(file) for file in files))


def load_described(args: argparse.Namespace) -> Scene:
    """As `load`, without printing; the scene has all the warnings."""
    from ssil_viewer.scene import load_scene

    # The small files first: an error in one of them should not wait for a large scene
    environment = None
    if args.lights is not None:
        load_lights(args.lights)
    if args.environment is not None:
        environment = load_environment(args.environment)
    kept = args.picture.lights if args.picture is not None else None
    lit = args.lights is not None or kept is not None or environment is not None and environment.replaces_sun
    scene = load_scene(args.scene, default_light=not lit)
    if kept is not None:
        scene = dataclasses.replace(scene, lights=kept)
    if args.lights is not None:
        scene = with_lights(scene, args.lights)
    if environment is not None:
        scene = dataclasses.replace(scene, environment=environment,
                                    warnings=(*scene.warnings, *environment.warnings))
    return scene


def warn(warnings: Sequence[str]) -> None:
    """Prints warnings on standard error, one line each, and not endlessly many."""
    for warning in warnings[:_WARNINGS_SHOWN]:
        print(f"ssil-viewer: warning: {' '.join(warning.split())}", file=sys.stderr)
    if len(warnings) > _WARNINGS_SHOWN:
        rest = len(warnings) - _WARNINGS_SHOWN
        print(f"ssil-viewer: warning: {rest} more, see ssil-viewer info", file=sys.stderr)


def camera_of(args: argparse.Namespace, scene: Scene) -> Camera:
    """The camera of scene or picture, or the one that was asked for, with --eye, --target, --up and --fov laid over it.

    Raises:
        UserError: No such camera, or vectors that do not span a view.
    """
    from ssil_viewer.scene import default_camera

    if args.camera is not None:
        camera = _named_camera(scene, args.camera)
    else:
        camera = args.picture.camera if args.picture is not None else default_camera(scene)
    changes = {name: getattr(args, name) for name in ("eye", "target", "up") if getattr(args, name) is not None}
    if {"eye", "target"} & changes.keys():
        changes["near"] = None      # the file's was chosen for its own view
    if args.fov is not None:
        changes["vertical_fov"] = math.radians(args.fov)
    camera = dataclasses.replace(camera, **changes)
    if {"eye", "target", "up"} & changes.keys():
        _check_view(camera)
    return camera


def camera_is_given(args: argparse.Namespace) -> bool:
    """Whether a picture or a flag says where the camera stands or what it sees."""
    return args.picture is not None or any(getattr(args, name) is not None
                                           for name in ("camera", "eye", "target", "up", "fov"))


def _check_view(camera: Camera) -> None:
    forward = np.subtract(camera.target, camera.eye)
    distance, height = np.linalg.norm(forward), np.linalg.norm(camera.up)
    if distance <= 1e-9:
        raise UserError("the camera stands on the point it looks at", "--eye", "move --eye or --target")
    if height <= 1e-9:
        raise UserError("the upward direction has no length", "--up", "give a vector such as 0,1,0")
    if np.linalg.norm(np.cross(forward / distance, np.asarray(camera.up) / height)) < 1e-6:
        raise UserError("the camera looks along its upward direction", "--up", "give another --up, such as 0,0,1")


def _named_camera(scene: Scene, name: str) -> Camera:
    names = [camera.name for camera in scene.cameras]
    if name in names:
        return scene.cameras[names.index(name)]
    index = values.number(name)
    if isinstance(index, int) and 0 <= index < len(names):
        return scene.cameras[index]
    if not names:
        advice = "the scene has none, give --eye and --target"
    elif near := difflib.get_close_matches(name, names, 1):
        advice = f"did you mean {near[0]}?"
    else:
        listed = ", ".join(f"{i} {n}".rstrip() for i, n in enumerate(names[:8]))
        advice = f"the scene has {len(names)}: {listed}" + (", ..." if len(names) > 8 else "")
    raise UserError(f"no camera is called {name!r}", "--camera", advice)
