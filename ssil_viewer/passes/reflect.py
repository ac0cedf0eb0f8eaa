"""Further bounces: light that arrived becomes light that is sent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Callable, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame

MOST_BOUNCES = 4


def at_least(bounces: int) -> Callable[[Settings], bool]:
    """Whether settings ask for so many bounces; for `Target.exists`."""
    return lambda settings: settings.gathered_bounces >= bounces


def irradiance_of(bounce: int) -> str:
    """The target with the irradiance of one bounce."""
    return "upsample" if bounce == 1 else f"upsample_{bounce}"


def sent_radiance(bounce: int) -> dict[str, str]:
    """`Dispatch.targets` of a pass that works on the radiance that a bounce begins with."""
    return {} if bounce == 1 else {"radiance": "bounce_radiance"}


class Reflect(ScreenPass):
    """Diffuse exitant radiance of the light that the last bounce brought: albedo / pi * E.

    Source: Soler et al. 2010, "more bounces by feeding the output back in".
    """

    name = "reflect"
    shader = "passes/reflect.glsl"
    reads = {"albedo": Read.of("albedo"), "upsample": Read.of("upsample")}
    writes = {"bounce_radiance": Target("rgb9e5", "diffuse exitant radiance that the last bounce but one left, "
                                                  "W m^-2 sr^-1", "pyramid", exists=at_least(2))}
    per_bounce = True
    first_bounce = 2

    def enabled(self, settings: Settings) -> bool:
        return settings.gathered_bounces >= 2

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        yield Dispatch(targets={"upsample": irradiance_of(frame.bounce - 1)})


class AddBounces(ScreenPass):
    """The irradiance of all bounces together."""

    name = "add_bounces"
    shader = "passes/add_bounces.glsl"
    reads = {irradiance_of(bounce): Read.of(irradiance_of(bounce), optional=bounce > 2)
             for bounce in range(1, MOST_BOUNCES + 1)}
    writes = {"all_bounces": Target("rgb9e5", "irradiance of all bounces in this frame alone, W m^-2",
                                    exists=at_least(2))}

    def enabled(self, settings: Settings) -> bool:
        return settings.gathered_bounces >= 2

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        missing = range(frame.settings.gathered_bounces + 1, MOST_BOUNCES + 1)
        yield Dispatch(omit=frozenset(irradiance_of(bounce) for bounce in missing))
