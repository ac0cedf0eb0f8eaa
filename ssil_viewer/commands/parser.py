"""argparse with this program's manners: one-line errors, nearest names, and values that begin with a minus."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Sequence
from typing import NoReturn

from ssil_viewer.commands import values
from ssil_viewer.errors import UserError
from ssil_viewer.settings import knobs, presets

_LOOKS_NEGATIVE = re.compile(r"-([0-9.,]|inf|nan)", re.IGNORECASE)


class Parser(argparse.ArgumentParser):
    """Raises UserError where argparse would print its usage and leave."""

    def __init__(self, prog: str, usage: str, description: str, epilog: str = "") -> None:
        super().__init__(
            prog,
            usage=f"{prog} {usage}",
            description=description,
            epilog=epilog,
            allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        self.add_argument("--debug", action="store_true", help="show the traceback of an error")

    def parse(self, arguments: Sequence[str]) -> argparse.Namespace:
        """Parses all arguments.

        Raises:
            UserError: Unknown flags, left-over words, missing or unfit values.
        """
        result, extra = self.parse_known_args(self._join_negative_values(arguments))
        # Unknown flags first: the word after one is often its value, taken for a scene.
        for word in sorted(extra, key=lambda word: not word.startswith("-")):
            if word.startswith("-"):
                name = word.partition("=")[0]
                raise UserError(f"unknown flag {name}", "", self._nearest(name))
            raise UserError(f"unexpected argument {word!r}", "", f"see {self.prog} --help")
        return result

    def error(self, message: str) -> NoReturn:
        subject, _, problem = message.removeprefix("argument ").partition(": ")
        advice = f"see {self.prog} --help"
        if "expected one argument" in problem:
            raise UserError("a value is missing", subject, advice)
        if "explicit argument" in problem:
            raise UserError("this flag takes no value", subject, advice)
        if subject == "the following arguments are required":
            raise UserError(f"{problem} is missing", "", advice)
        raise UserError(message, "", advice)

    # `_actions` is argparse's own, and has been there under this name since its first release; there is no public list.

    def _nearest(self, name: str) -> str:
        known = [flag for action in self._actions for flag in action.option_strings]
        near = difflib.get_close_matches(name, known, 1, 0.7)
        return f"did you mean {near[0]}?" if near else f"see {self.prog} --help"

    def _join_negative_values(self, arguments: Sequence[str]) -> list[str]:
        """Turns `--eye -9,4,0` into `--eye=-9,4,0`, since argparse takes the vector for a flag."""
        takes_value = {flag for action in self._actions if action.nargs is None for flag in action.option_strings}
        joined: list[str] = []
        rest = list(arguments)
        while rest:
            word = rest.pop(0)
            if word == "--":
                return [*joined, word, *rest]
            if word.endswith("=--"):  # argparse of Python 3.11 and 3.12 stumbles over it
                raise UserError("a value is missing", word.removesuffix("=--"), f"see {self.prog} --help")
            if word in takes_value and word.startswith("--") and rest and _LOOKS_NEGATIVE.match(rest[0]):
                word += "=" + rest.pop(0)
            joined.append(word)
        return joined


def add_scene(parser: Parser, default: str | None = None) -> None:
    """Adds the SCENE argument, and the flags for light that comes from other files."""
    parser.set_defaults(picture=None)
    text = "a .gltf, .glb, .obj, .ply, .stl, .off, .3mf or .dae file, or builtin:NAME (see ssil-viewer scenes), or a "\
           "saved .png: its scene, view, light and settings"
    light = parser.add_argument_group("light")
    light.add_argument("--lights", metavar="FILE", help="a TOML file of lights, in place of the scene's own; see "
                       "docs/lights.md")
    light.add_argument("--environment", metavar="FILE", help="an equirectangular .hdr or .exr that lights the "
                       "scene and is its backdrop; or builtin:sky, builtin:overcast")
    if default is None:
        parser.add_argument("scene", metavar="SCENE", help=text)
    else:
        parser.add_argument("scene", metavar="SCENE", nargs="?", default=default, help=f"{text}; default {default}")


def add_image_flags(parser: Parser, frames_help: str, as_picture: bool = True) -> None:
    """Adds the flags that say what is rendered: size, camera, presets and every setting.

    Args:
        as_picture: A saved picture in place of the scene gives its size, too.
    """
    image = parser.add_argument_group("image")
    image.add_argument("--size", type=values.size, metavar="WxH",
                       help="pixels, default 1280x720" + (" or those of a saved picture" if as_picture else ""))
    parser.set_defaults(usual_size=(1280, 720), size_as_picture=as_picture)
    image.add_argument("--frames", type=values.whole("--frames", 1, 1_000_000), metavar="N", help=frames_help)

    camera = parser.add_argument_group("camera", "Vectors are x,y,z in metres, +Y up.")
    camera.add_argument("--camera", metavar="INDEX_OR_NAME", help="a camera of the scene file")
    camera.add_argument("--eye", type=values.vector("--eye"), metavar="x,y,z", help="where the camera stands")
    camera.add_argument("--target", type=values.vector("--target"), metavar="x,y,z", help="what it looks at")
    camera.add_argument("--up", type=values.vector("--up"), metavar="x,y,z", help="upward direction")
    camera.add_argument("--fov", type=values.field_of_view, metavar="DEG", help="vertical field of view, degrees")

    files = parser.add_argument_group("settings", "The later wins: defaults, saved picture, preset, settings "
                                       "file, flags.")
    files.add_argument("--preset", metavar="NAME", help="a shipped preset: " + ", ".join(presets()))
    files.add_argument("--settings", metavar="FILE", help="a TOML file of settings, see docs/settings.md")
    add_setting_flags(parser)


def add_setting_flags(parser: Parser) -> None:
    """Adds one flag for each setting; a flag that was not given leaves no trace in the result."""
    groups: dict[str, argparse._ArgumentGroup] = {}
    for info in knobs():
        title = info.knob.group.lower()
        if title not in groups:
            groups[title] = parser.add_argument_group(title)
        text = info.text.replace("%", "%%")
        common = {"dest": info.name, "default": argparse.SUPPRESS}
        if info.type is bool:
            text += f" Default {'on' if info.default else 'off'}."
            groups[title].add_argument(info.flag, action=argparse.BooleanOptionalAction, help=text, **common)
            continue
        if info.choices:
            shape = "|".join(info.choices)
            text += f" Default {info.default}."
        else:
            shape = "N" if info.type is int else "X"
            text += f" {info.span}, default {info.default:.10g}."
        groups[title].add_argument(info.flag, type=values.knob_value(info), metavar=shape, help=text, **common)
