"""Pictures of other light than the frame's own, shown as it shows its own: exposure, tone curve, sRGB, smooth edges."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from ssil_viewer.gpu.screen_program import Variant
from ssil_viewer.gpu.targets import Target, TargetSet
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.passes import Antialias, Composite
from ssil_viewer.passes.base import switch
from ssil_viewer.settings import Settings

PICTURE_TARGETS = {name: Composite.writes[name] for name in ("display", "aliased")}
"""What `draw_picture` draws to, under the settings that it is given."""


def draw_picture(runner: PassRunner, variant: Variant, settings: Settings, targets: TargetSet,
                 inputs: dict[str, moderngl.Texture], uniforms: dict[str, object]) -> moderngl.Texture:
    """Run `Composite` with other inputs.

    Args:
        variant: As that pass compiles under these settings, but for its inputs; writes the display alone.
        settings: Those of the runner, but that antialiasing may differ.
        targets: Has `PICTURE_TARGETS` under these settings, in the size of the image.

    Returns:
        Their `display`.
    """
    drawn, _ = Composite.drawn_to(settings)
    runner.unbind()
    runner.shade(variant, targets, inputs, {"display": targets.texture(drawn)}, uniforms)
    if drawn == "aliased":
        smoothing = Variant(Antialias.shader, ((drawn, Composite.writes[drawn].format),), (),
                            (("display", Composite.writes["display"].format),), ())
        runner.shade(smoothing, targets, {drawn: targets.texture(drawn)}, {"display": targets.texture("display")}, {})
    return targets.texture("display")


def picture_of(runner: PassRunner, radiance: np.ndarray, antialias: bool) -> np.ndarray:
    """How the display would show an image.

    Args:
        radiance: (H, W, 3) of the runner's size, linear, row 0 = top, in `final`'s unit.

    Returns:
        (H, W, 3) uint8, sRGB-encoded, row 0 = top.
    """
    settings, (width, height) = replace(runner.settings, antialias=antialias), runner.size
    drawn, smoothed = Composite.drawn_to(settings)
    defines = (switch("SHOW", "direct", Composite.shows), switch("TONE_MAP", settings.tone_map, Composite.tone_maps),
               *smoothed)
    variant = Variant(Composite.shader, (("direct", "rgba16f"),), (), (("display", Composite.writes[drawn].format),),
                      (("band", "ivec2"),), defines)
    scratch = TargetSet(runner.context, runner.size, settings,
                        {"direct": Target("rgba16f", "", cropped=True), **PICTURE_TARGETS})
    texels = np.zeros((height, width, 4), np.float16)
    texels[..., :3] = np.clip(radiance[::-1], 0.0, np.finfo(np.float16).max)
    try:
        scratch.texture("direct").write(texels.tobytes())
        return read_picture(draw_picture(runner, variant, settings, scratch, {"direct": scratch.texture("direct")},
                                         {"band": (0, 0)}))
    finally:
        scratch.release()


def read_picture(picture: moderngl.Texture) -> np.ndarray:
    """Codes of an RGBA8 texture: (H, W, 3) uint8, sRGB-encoded, row 0 = top."""
    data = np.frombuffer(picture.read(), np.uint8).reshape(picture.height, picture.width, 4)
    return np.ascontiguousarray(data[::-1, :, :3])
