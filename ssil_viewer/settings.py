"""Every tunable of the program, each defined once.

A setting is a field of `Settings` annotated with a `Knob`. The command-line flag, the slider, the preset
key, the range check, the tooltip and docs/settings.md are all made from that one line: the field
`start_level` is the flag `--start-level` and the TOML key `start_level`.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Iterator, Literal

from ssil_viewer.errors import UserError
from ssil_viewer.toml_file import read_toml

Affects = Literal["display", "history", "resources"]


@dataclass(frozen=True)
class Need:
    """Something without which a setting has no effect.

    Attributes:
        of: Another setting, or one of `SCENE_NEEDS`.
        value: What the other setting must be; None: above 0.
    """

    of: str
    value: str | bool | None = None

    def __str__(self) -> str:
        """In words."""
        if self.of in SCENE_NEEDS:
            return self.of
        how = {None: "above 0", True: "on"}.get(self.value, self.value)
        return f"{self.of.replace('_', ' ')} {how}"


ENVIRONMENT, GLOSSY = "an environment map", "glossy materials"
SCENE_NEEDS = frozenset({ENVIRONMENT, GLOSSY})
"""What not every scene has, in words."""

_BOUNCES, _TEMPORAL = Need("bounces"), Need("temporal", True)
_HORIZON, _VOXELS = Need("visibility", "horizon"), Need("visibility", "voxel")


@dataclass(frozen=True)
class Knob:
    """What a setting means and how it may be turned.

    Attributes:
        help: One or two sentences: the effect, then what it costs.
        low, high: Inclusive range of numbers; None where the type has none.
        step: Whole numbers go up from `low` by this.
        powers: They are powers of two instead.
        unit: Physical or image unit, empty for plain numbers.
        log: Whether a slider should be logarithmic.
        affects: What a change invalidates: "display" nothing, "history" the temporal history,
            "resources" the render targets (and with them the history).
        group: Heading under which the setting is shown.
        flag: Command-line spelling where it is not the field's name.
        needs: Without which it has no effect; what these settings need themselves is not repeated.
    """

    help: str
    low: float | None = None
    high: float | None = None
    unit: str = ""
    step: int = 1
    powers: bool = False
    log: bool = False
    affects: Affects = "history"
    group: str = "Gather"
    flag: str = ""
    needs: tuple[Need, ...] = ()


@dataclass(frozen=True)
class KnobInfo:
    """A setting as the command line, the GUI and the documentation see it.

    Attributes:
        name: Field of `Settings` and preset key.
        type: int, float, bool or str.
        choices: Allowed strings, empty for other types.
        default: Value in `Settings()`.
    """

    name: str
    type: type
    choices: tuple[str, ...]
    default: Any
    knob: Knob

    @property
    def flag(self) -> str:
        """The command-line flag, with its leading dashes."""
        return "--" + (self.knob.flag or self.name.replace("_", "-"))

    @property
    def text(self) -> str:
        """What it does, and what it needs beside a bounce, which nearly all need."""
        needs = " and ".join(str(need) for need in self.knob.needs if need != _BOUNCES)
        return f"{self.knob.help} Needs {needs}." if needs else self.knob.help

    @property
    def span(self) -> str:
        """Smallest and largest value of a number, in words."""
        return f"{self.knob.low:.10g} to {self.knob.high:.10g}{', powers of two' if self.knob.powers else ''}"

    def nearest(self, value: float) -> int:
        """The whole number that a slider's place stands for: the nearest one that fits."""
        low, step = int(self.knob.low), self.knob.step
        if self.knob.powers:
            return 1 << round(math.log2(max(value, 1)))
        return low + round((value - low) / step) * step

    def check(self, value: Any, where: str = "") -> Any:
        """The value in the setting's own type, or UserError when it does not fit.

        Numbers are never clamped: what the user asked for either happens or is refused.

        Args:
            where: The flag or file that it comes from, for messages; a program's own values come from neither.
        """
        if self.type is bool:
            if not isinstance(value, bool):
                raise self._misfit(value, "true or false", where)
            return value
        if self.type is str:
            if value not in self.choices:
                near = difflib.get_close_matches(str(value), self.choices, 1)
                hint = f"did you mean {near[0]}?" if near else "choose " + ", ".join(self.choices)
                raise UserError(f"{self.name} cannot be {str(value)!r}", where, hint)
            return value
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:  # NaN
            raise self._misfit(value, f"a number from {self.span}", where)
        if not self.knob.low <= value <= self.knob.high:
            raise self._misfit(value, f"a value from {self.span}", where)
        if self.type is int and value != int(value):
            raise self._misfit(value, "a whole number", where)
        if self.type is int and (value - self.knob.low) % self.knob.step:
            raise self._misfit(value, f"a multiple of {self.knob.step}", where)
        if self.knob.powers and int(value) & (int(value) - 1):
            raise self._misfit(value, "a power of two", where)
        return self.type(value)

    def _misfit(self, value: Any, wanted: str, where: str) -> UserError:
        advice = "write it without quotes" if self._fits_unquoted(value) else f"give {wanted}"
        return UserError(f"{self.name} cannot be {value!r}", where, advice)

    def _fits_unquoted(self, value: Any) -> bool:
        """Whether a text spells a value that would fit."""
        if not isinstance(value, str):
            return False
        try:
            self.check({"true": True, "false": False}[value] if self.type is bool else float(value))
        except (KeyError, ValueError, UserError):
            return False
        return True


@dataclass(frozen=True)
class Settings:
    """The tunables of the renderer. Immutable: a change is a new object (`dataclasses.replace`).

    Raises:
        UserError: A value is out of range; names the setting.
    """

    start_level: Annotated[int, Knob(
        "Mip level where the gather starts: 0 full, 1 half, 2 quarter resolution. "
        "One level lower costs four times as much.",
        0, 6, affects="resources")] = 2
    levels: Annotated[int, Knob(
        "Number of levels gathered. Each doubles the reach on screen and costs a quarter of the one before.",
        1, 8, affects="resources")] = 4
    samples: Annotated[int, Knob(
        "Samples per pixel and level. Noise falls with its square root, cost grows in proportion.",
        1, 1024, log=True, needs=(_BOUNCES,))] = 64
    radius: Annotated[float, Knob(
        "Radius of the disc and of the rings at every level, in texels of a 720-line image. "
        "The reach is radius * 2^(start level + levels - 1) pixels; a wide disc is noisier close by.",
        1.0, 512.0, "texels", log=True, needs=(_BOUNCES,))] = 48.0
    form_factor: Annotated[Literal["disc", "point"], Knob(
        "disc: point-to-disc form factor, finite at contact. point: the plain one, which explodes there; "
        "for comparison.", needs=(_BOUNCES,))] = "disc"
    sample_spacing: Annotated[Literal["radius", "area"], Knob(
        "radius: samples evenly spaced in radius, most of them near the receiver. area: evenly in area as in the "
        "talk, much noisier near contacts; there the form factor matters most; for comparison.",
        needs=(_BOUNCES,))] = "radius"
    visibility: Annotated[Literal["off", "voxel", "horizon"], Knob(
        "Whether geometry between sender and receiver blocks light. voxel: a grid of the view frustum is walked for "
        "every sample, as in the talk; the gather then takes several times as long. horizon: samples lie in rows that "
        "remember which elevations are blocked; up to twice the time.", affects="resources",
        needs=(_BOUNCES,))] = "horizon"
    thickness: Annotated[float, Knob(
        "How far a visible surface reaches back from the camera, as a share of its depth, where horizon asks what it "
        "blocks.", 0.0, 1.0, group="Visibility", needs=(_HORIZON,))] = 0.1
    visibility_rays: Annotated[int, Knob(
        "Pairs of rays per pixel and level against the scene's triangles: one tells how much of what horizon sees is "
        "seen, one how much of what it hides is hidden, and pixels tell what texels send. Shadows are right in the "
        "mean, whatever the thickness. No screen-space method does this; 0 switches it off. Cost grows in proportion.",
        0, 16, affects="resources", group="Visibility", needs=(_HORIZON,))] = 0
    voxel_fill: Annotated[Literal["solid", "surface"], Knob(
        "solid: the inside of closed bodies blocks light, and the surface of what is open. surface: surfaces alone; "
        "thin walls block more surely, slanted ones shadow themselves more easily.", group="Visibility",
        needs=(_VOXELS,))] = "solid"
    voxel_slices: Annotated[int, Knob(
        "Depth slices of the voxel grid. Twice as many halve the error in depth and double the grid's memory.",
        128, 256, step=128, affects="resources", group="Visibility", needs=(_VOXELS,))] = 128
    voxel_view_slice: Annotated[int, Knob(
        "Slice that the buffer voxel_slice shows, 0 is the nearest.",
        0, 255, affects="display", group="Visibility", needs=(_VOXELS,))] = 64
    guard_band: Annotated[int, Knob(
        "Border that is rendered around the image and cut off at the end, so that light from just outside does not pop "
        "in at the edge; at each side, a share of the image's width and height, rounded up to whole texels of the "
        "coarsest level. Costs what so many more pixels cost.",
        0, 25, "%", affects="resources")] = 0
    bounces: Annotated[int, Knob(
        "Indirect bounces; 0 shows direct light only and skips the indirect passes. Each costs as much as the first.",
        0, 4, affects="resources")] = 1
    feedback: Annotated[bool, Knob(
        "Light of the last frame is sent on: all further bounces for the price of one, a frame apart; bounces "
        "beyond the first are not gathered then.", affects="resources", needs=(_BOUNCES, _TEMPORAL))] = False
    unseen_samples: Annotated[int, Knob(
        "Pairs of rays per texel of the starting level for light from surfaces that the image does not show: outside "
        "of it, behind the camera, behind other things. They are traced against the scene's triangles, which no "
        "screen-space method does; 0 switches them off. Cost grows in proportion.",
        0, 32, affects="resources", group="Unseen light", needs=(_BOUNCES,))] = 0
    unseen_from: Annotated[Literal["everywhere", "view"], Knob(
        "Which of these surfaces send: all of them, or only what the camera sees and no pixel has, such as ledges seen "
        "edge-on, which is as far as a method could get that knows what the camera sees.",
        group="Unseen light", needs=(Need("unseen_samples"),))] = "everywhere"
    mip_filter: Annotated[Literal["vote", "nearest", "average"], Knob(
        "How four texels of depth and normal become one. vote keeps the most typical surface and is steady; "
        "nearest flickers, average invents surfaces; both for comparison.", group="Mipmaps")] = "vote"
    glossy_samples: Annotated[int, Knob(
        "Samples per pixel and level for the reflection of indirect light by glossy surfaces, on top of those for "
        "diffuse light; 0 switches it off. Scenes without glossy materials never spend them.",
        0, 1024, affects="resources", group="Glossy", needs=(_BOUNCES, Need(GLOSSY)))] = 16
    importance_sampling: Annotated[bool, Knob(
        "Take the glossy samples only where the lobe of the reflection lies in the image. Off, they lie all around, "
        "and most of them miss it; for comparison.", group="Glossy", needs=(Need("glossy_samples"),))] = True
    upsampling: Annotated[Literal["bilateral", "nearest"], Knob(
        "How coarse light reaches fine pixels. bilateral respects depth and normal edges; "
        "nearest shows the blocks, for comparison.", group="Upsampling", needs=(_BOUNCES,))] = "bilateral"
    temporal: Annotated[bool, Knob(
        "Reuse of the last frames' light by reverse reprojection. Removes noise and flicker at a constant "
        "cost.", affects="resources", group="Temporal")] = True
    temporal_frames: Annotated[int, Knob(
        "Longest running mean of the temporal filter. More is steadier and reacts later to moving lights.",
        1, 256, "frames", log=True, group="Temporal", needs=(_TEMPORAL, _BOUNCES))] = 32
    show: Annotated[Literal["both", "direct", "indirect", "glossy"], Knob(
        "Which light is shown. indirect: diffuse and glossy. glossy: the reflection of indirect light alone.",
        affects="display", group="Display")] = "both"
    exposure: Annotated[float, Knob(
        "Brightness of the display in stops; never touches exported values.",
        -16.0, 16.0, "EV", affects="display", group="Display")] = 0.0
    tone_map: Annotated[Literal["neutral", "aces", "reinhard", "linear"], Knob(
        "Curve from radiance to display: neutral (Khronos; hues of what is lit stay, dark colours lose up to 0.04), "
        "aces (filmic contrast; darkens the shadows where indirect light is), reinhard (flat), linear (clips).",
        affects="display", group="Display")] = "neutral"
    antialias: Annotated[bool, Knob(
        "Smooth the edges of the picture, by what it shows itself, in one pass at its end. Never touches exported "
        "values.", affects="display", group="Display")] = True
    shadow_resolution: Annotated[int, Knob(
        "Side of the shadow map of a directional light; spots get a quarter, faces of point and area lights an eighth.",
        128, 8192, "texels", powers=True, log=True, group="Shadows")] = 4096
    area_shadow_samples: Annotated[int, Knob(
        "Points on each area light from which its shadow is drawn, on spheres twice as many. More make smoother "
        "penumbrae; each costs three shadow maps when something moves, and lookups in every pixel that is lit.",
        1, 16, group="Shadows")] = 9
    shadow_rays: Annotated[bool, Knob(
        "Wherever the shadow map of a lamp or the sun leaves light, a ray against the scene's triangles decides: "
        "shadows as sharp as the image. A ray for each lit pixel and each of the first 16 lamps, and seconds to "
        "prepare a large scene.",
        affects="resources", group="Shadows")] = False
    environment_strength: Annotated[float, Knob(
        "Brightness of the environment map, in stops; 0 leaves it as the file has it.",
        -16.0, 16.0, "EV", group="Environment", needs=(Need(ENVIRONMENT),))] = 0.0
    environment_rotation: Annotated[float, Knob(
        "Turn of the environment about +Y, counter-clockwise seen from above.",
        -180.0, 180.0, "degrees", group="Environment", needs=(Need(ENVIRONMENT),))] = 0.0
    sky_directions: Annotated[int, Knob(
        "Slices in which each texel of the starting level looks for what hides the environment. Cost grows in "
        "proportion.", 1, 16, group="Environment", needs=(Need(ENVIRONMENT),))] = 4
    sky_steps: Annotated[int, Knob(
        "Steps to each side of a slice, closer together near by. Cost grows in proportion.",
        1, 64, group="Environment", needs=(Need(ENVIRONMENT),))] = 16
    sky_thickness: Annotated[float, Knob(
        "Assumed thickness of what hides the environment, as a share of its distance from the camera. Less lets light "
        "pass behind thin things, and leak through walls.", 0.001, 10.0, log=True, group="Environment",
        needs=(Need(ENVIRONMENT),))] = 0.1
    seed: Annotated[int, Knob(
        "Fixes every random choice: same machine, same flags, same bytes.", 0, 2**31 - 1)] = 0

    def __post_init__(self) -> None:
        for info in knobs():
            object.__setattr__(self, info.name, info.check(getattr(self, info.name)))

    @property
    def last_level(self) -> int:
        """Coarsest level of the pyramid that the gather reads."""
        return self.start_level + self.levels - 1

    @property
    def feeds_back(self) -> bool:
        """Whether the light of the last frame is sent on."""
        return self.feedback and self.temporal and self.bounces > 0

    @property
    def gathered_bounces(self) -> int:
        """Bounces that are gathered one after the other in a frame."""
        return 1 if self.feeds_back else self.bounces

    def affected_by(self, other: Settings) -> Affects | None:
        """The strongest invalidation that going from self to `other` needs, or None if they are equal."""
        strength: tuple[Affects, ...] = ("display", "history", "resources")
        changed = [i.knob.affects for i in knobs() if getattr(self, i.name) != getattr(other, i.name)]
        return max(changed, key=strength.index, default=None)

    def replaced(self, values: dict[str, Any], source: str = "") -> Settings:
        """A copy with some values changed by name.

        Args:
            values: Setting names and values; names with dashes are accepted.
            source: File that names and values come from, for messages.

        Raises:
            UserError: An unknown name (the nearest is suggested) or a value out of range.
        """
        known = {info.name: info for info in knobs()}
        clean = {name.replace("-", "_"): value for name, value in values.items()}
        for name in clean:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                raise UserError(f"no setting is called {name!r}", source,
                                f"did you mean {near[0]}?" if near else "see docs/settings.md")
        return dataclasses.replace(self, **{name: known[name].check(value, source) for name, value in clean.items()})


def knobs() -> tuple[KnobInfo, ...]:
    """All settings in the order of their definition."""
    return _KNOBS


def of_display(settings: Settings) -> dict[str, Any]:
    """Name -> value of what concerns the display alone."""
    return {info.name: getattr(settings, info.name) for info in knobs() if info.knob.affects == "display"}


def load_settings(path: Path, base: Settings | None = None) -> Settings:
    """Settings from a TOML file of `name = value` lines, over `base` or the defaults.

    Raises:
        UserError: The file is missing, is not TOML, or holds an unknown name or an unfit value.
    """
    values = read_toml(path, "settings file")
    if isinstance(values.get("light"), list):
        raise UserError("this is a file of lights", str(path), "give it to --lights")
    if tables := [name for name, value in values.items() if isinstance(value, dict)]:
        raise UserError(f"there are no tables in a file of settings: [{tables[0]}]", str(path),
                        "write name = value lines without headings")
    return (base or Settings()).replaced(values, str(path))


def settings_in(path: Path) -> set[str]:
    """Names of the settings that a file of `load_settings` says."""
    return {name.replace("-", "_") for name in read_toml(path, "settings file")}


def presets() -> dict[str, Path]:
    """Names and files of the shipped presets; each file holds differences from the defaults only."""
    folder = Path(__file__).with_name("presets")
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_preset(name: str, base: Settings | None = None) -> Settings:
    """Settings of a shipped preset. Raises UserError for an unknown name, with the nearest one."""
    found = presets()
    if name not in found:
        near = difflib.get_close_matches(name, found, 1)
        hint = f"did you mean {near[0]}?" if near else "choose " + ", ".join(found)
        raise UserError(f"no preset is called {name!r}", "--preset", hint)
    return load_settings(found[name], base)


def _read_knobs() -> Iterator[KnobInfo]:
    hints = typing.get_type_hints(Settings, include_extras=True)
    for item in dataclasses.fields(Settings):
        base, knob = typing.get_args(hints[item.name])
        literal = typing.get_origin(base) is Literal
        choices = typing.get_args(base) if literal else ()
        yield KnobInfo(item.name, str if literal else base, choices, item.default, knob)


_KNOBS = tuple(_read_knobs())
