"""Pictures of a reference on the GPU: the image under its light, and the error as colours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np

from ssil_viewer.buffers import BUFFERS
from ssil_viewer.frame import Frame
from ssil_viewer.gpu.screen_program import Variant
from ssil_viewer.gpu.targets import TargetSet
from ssil_viewer.passes import Composite
from ssil_viewer.passes.antialias import smooths_edges
from ssil_viewer.picture import PICTURE_TARGETS, draw_picture, read_picture
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference.gpu_sums import ProgressiveReference

Color = tuple[float, float, float]

SIGNED: tuple[Color, ...] = ((0.02, 0.19, 0.58), (0.35, 0.62, 0.88), (0.96, 0.96, 0.95), (0.94, 0.55, 0.38),
                             (0.60, 0.03, 0.10))
"""sRGB colours at even steps from too dark over right to too bright: blue and red, which all eyes tell apart."""

ABSOLUTE: tuple[Color, ...] = ((0.0, 0.0, 0.02), (0.34, 0.06, 0.43), (0.74, 0.21, 0.33), (0.98, 0.56, 0.04),
                               (0.99, 1.0, 0.64))
"""sRGB colours at even steps from no error to much: Matplotlib's inferno at quarters, lighter all the way."""


@dataclass(frozen=True)
class Scale:
    """How errors become colours.

    Attributes:
        limit: Error at the scale's end, relative to the reference's mean.
        signed: From -limit, where ours is too dark, to limit; otherwise from 0.
        block: Pixels along each side of the squares whose means are compared.
    """

    limit: float = 0.5
    signed: bool = True
    block: int = 1

    @property
    def stops(self) -> tuple[Color, ...]:
        """The colours at even steps."""
        return SIGNED if self.signed else ABSOLUTE

    @property
    def values(self) -> tuple[float, ...]:
        """The relative errors that the stops stand for."""
        first = -self.limit if self.signed else 0.0
        return tuple(first + (self.limit - first) * step / 4 for step in range(5))


class ReferencePictures:
    """Draws pictures of the renderer's size; one at a time.

    Raises:
        UserError: There is not enough memory.
    """

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._targets: TargetSet | None = None
        self._fit()

    def _fit(self) -> TargetSet:
        renderer = self._renderer
        fits = self._targets is not None and self._targets.size == renderer.size
        if not fits or self._targets.has("aliased") != smooths_edges(renderer.settings):
            self.release()
            self._targets = TargetSet(renderer.context, renderer.size, renderer.settings, PICTURE_TARGETS)
        return self._targets

    def image(self, reference: ProgressiveReference) -> moderngl.Texture:
        """The last frame's picture with the reference's irradiance in place of our own."""
        runner = self._renderer.runner
        composite = next(p for p in runner.passes if isinstance(p, Composite))
        dispatch, = composite.dispatches(Frame(runner, runner.settings, runner.radius))
        shown = tuple(define for define in dispatch.defines if not define[0].startswith("WRITE_"))
        dispatch = replace(dispatch, defines=shown, omit=dispatch.omit | {"final", "glossy"})
        variant, inputs, _ = runner.bind(composite, dispatch)
        variant = replace(variant, reads=tuple((name, "rgba32f" if name == "irradiance" else form)
                                               for name, form in variant.reads))
        inputs["irradiance"] = reference.texture()
        return draw_picture(runner, variant, runner.settings, self._fit(), inputs, dispatch.uniforms)

    def error(self, reference: ProgressiveReference, mean: float, scale: Scale) -> moderngl.Texture:
        """Our irradiance minus the reference's, as colours.

        Args:
            mean: Of the reference over the image, W m^-2.
        """
        runner = self._renderer.runner
        target = BUFFERS["indirect"].pick(runner.plan.running_targets)
        reads = (("ours", runner.declared[target].format), ("reference", "rgba32f"), ("surface", "surface"))
        variant = Variant("reference/error.glsl", reads, (), (("display", "rgba8"),), (
            ("first", "ivec2"), ("image_size", "ivec2"), ("block", "int"), ("mean", "float"), ("limit", "float"),
            ("is_signed", "int"), ("stops[5]", "vec3")))
        inputs = {"ours": runner.targets.texture(target), "reference": reference.texture(),
                  "surface": runner.targets.texture("surface")}
        display = self._fit().texture("display")
        runner.unbind()
        runner.shade(variant, self._targets, inputs, {"display": display}, {
            "first": runner.band, "image_size": self._renderer.size, "block": scale.block, "mean": max(mean, 1e-30),
            "limit": scale.limit, "is_signed": int(scale.signed), "stops": list(scale.stops)})
        return display

    def read(self) -> np.ndarray:
        """The last picture: (H, W, 3) uint8, sRGB-encoded, row 0 = top."""
        self._renderer.timers.disturb()
        return read_picture(self._fit().texture("display"))

    def release(self) -> None:
        """Free all GPU memory."""
        if self._targets is not None:
            self._targets.release()
            self._targets = None
