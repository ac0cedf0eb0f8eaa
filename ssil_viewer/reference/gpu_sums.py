"""References R1 and R2 on the GPU, of every pixel, a part at a time.

The estimator, the senders and the rays are those of `all_pixels` and `visible_pixels`; sums are compensated single
precision. Every pixel takes the senders in slices (shaders/reference/sum.glsl). After one sweep through all of them R1
is complete; R2 goes on in further sweeps, each with rays of its own, one ray for each pixel and slice.

Nothing here is part of a frame: textures exist from `ProgressiveReference(...)` to `release()`.
"""

from __future__ import annotations

import math
import time
from typing import Literal

import moderngl
import numpy as np

from ssil_viewer.gpu.screen_program import Variant
from ssil_viewer.gpu.targets import Target, TargetSet, level_size, rendered_size, target_bytes, texture_bytes
from ssil_viewer.gpu.triangle_tables import GpuTriangles, TriangleTables
from ssil_viewer.passes.base import switch
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.triangles import LIFT

Kind = Literal["R1", "R2"]

SENDERS_OF_SLICE = 16
"""About how many senders a slice has unless more rays are asked for: few enough that one turn of a window on software
OpenGL stays short, so many that a ray, which costs as much as some of them, does not dominate."""

MOST_SENDERS_AT_ONCE = 4096
"""Of one run of the shader, which has about as many turns of loops: llvmpipe ends all loops of an invocation for good
after 65535 turns, without a word."""

_MOST_RAYS_AT_ONCE = 8      # each may walk through thousands of nodes; see MOST_SENDERS_AT_ONCE
_FIRST_PART_BITS, _MOST_PART_BITS = 2, 4     # more parts only after they have shown to be slow
RAYS = 256
"""Least number of R2's rays for each pixel that `ProgressiveReference` makes by itself: 2 to 3 % of noise in a pixel,
below half a percent in means of 8x8 pixels."""

_TEXEL = "rgba32f"


def slice_bits(senders: tuple[int, int], rays: int | None = None) -> int:
    """b of 4^b slices, for so many senders along each side.

    Args:
        rays: At least so many slices; None: about SENDERS_OF_SLICE senders in each.
    """
    bits = 0
    wanted = senders[0] * senders[1] / SENDERS_OF_SLICE if rays is None else rays
    wanted = max(wanted, senders[0] * senders[1] / MOST_SENDERS_AT_ONCE)
    while 4**bits < wanted and 2**bits < max(senders):
        bits += 1
    return bits


class ProgressiveReference:
    """The irradiance of one bounce of the last frame's light, from all pixels (R1) or from those that are seen (R2).

    `renderer` has to have rendered a frame with bounces; while that shows the same view and light, `advance` adds to
    the sums. After any change to them, call `restart`. Triangles block where the scene has them: an instance that
    `Renderer.move_instance` moved is not followed.

    Args:
        renderer: Its last frame counts; its shaders' uniforms are used.
        kind: "R1" or "R2".
        rays: R2: rays for each pixel, rounded up to whole sweeps. None: whole sweeps of small slices, RAYS at least.
        pixels: The image's own pixels send, with the normals of their triangles, as `all_pixels.Senders.of_pixels`;
            else the texels of the starting level do, which takes a sixteenth of the time where that is a quarter.
        tables: R2: of the renderer's scene, if somebody has made them already.

    Raises:
        UserError: There is not enough memory.
    """

    def __init__(self, renderer: Renderer, kind: Kind, rays: int | None = None,
                 tables: TriangleTables | None = None, pixels: bool = False) -> None:
        self.kind = kind
        self._pixels = pixels
        self._renderer, self._rays = renderer, rays
        self._names = ("sum", "lost", "hidden", "hidden_lost") if kind == "R2" else ("sum", "lost")
        self._triangles: GpuTriangles | None = None
        self._targets: TargetSet | None = None
        self._ends: TargetSet | None = None
        self._at_once = 1
        self._part_bits = _FIRST_PART_BITS
        self._round_seconds = 0.0
        if kind == "R2":
            made = tables or TriangleTables.of(renderer.scene, renderer.origin)
            self._triangles = GpuTriangles(renderer.context, made)
        try:
            self.restart()
        except BaseException:
            self.release()
            raise

    def restart(self) -> None:
        """Forget the sums: the view or the light is another one. Sizes may have changed, too."""
        renderer = self._renderer
        self._level = 0 if self._pixels else renderer.settings.start_level
        self._senders = level_size(renderer.size, self._level)
        self._bits = slice_bits(self._senders, self._rays)
        self.slices_done = 0
        self._part = 0      # of the slices that are being added
        self._round_seconds = 0.0
        shape = renderer.size, rendered_size(renderer.size, renderer.settings)
        if self._targets is None or self._shape != shape:
            self._release_targets()
            self._shape = shape
            targets = {name: Target(_TEXEL, "", history=True, cropped=True) for name in self._names}
            self._targets = TargetSet(renderer.context, renderer.size, renderer.settings, targets | {
                "reference": Target(_TEXEL, "irradiance E, W m^-2, times the material's occlusion map")})
        if self.kind == "R2":
            self._find_ends()

    # -- how far it is -------------------------------------------------------------------------------------------------

    @property
    def slices(self) -> int:
        """Slices of one sweep."""
        return 4**self._bits

    @property
    def slices_wanted(self) -> int:
        """When it is done: R1 after one sweep, R2 after as many as bring the rays that were asked for."""
        if self.kind == "R1":
            return self.slices
        return self.slices * -(-(self._rays or RAYS) // self.slices)

    @property
    def progress(self) -> float:
        """Share that is done, 0 to 1."""
        return min(self.slices_done / self.slices_wanted, 1.0)

    @property
    def done(self) -> bool:
        """Whether all is summed that was asked for."""
        return self.slices_done >= self.slices_wanted

    @property
    def senders_seen(self) -> int:
        """Senders that each pixel has summed up on average, at most all there are."""
        return round(self._senders[0] * self._senders[1] * min(self.slices_done / self.slices, 1.0))

    @property
    def rays_done(self) -> int:
        """Rays of each pixel at most: none is needed for a slice that sends it nothing."""
        return self.slices_done if self.kind == "R2" else 0

    # -- work ----------------------------------------------------------------------------------------------------------

    @property
    def most_at_once(self) -> int:
        """Slices of one run of the shader at most."""
        of_slice = -(-self._senders[0] >> self._bits) * -(-self._senders[1] >> self._bits)
        most = max(MOST_SENDERS_AT_ONCE // of_slice, 1)
        return most if self.kind == "R1" else min(most, _MOST_RAYS_AT_ONCE)

    def advance_for(self, seconds: float) -> None:
        """Go on for about so long, at least by one slice of a part of the image; the GPU is waited for."""
        end = time.perf_counter() + seconds
        while not self.done:
            begun = time.perf_counter()
            self._advance(self._at_once)
            self._renderer.context.finish()
            now = time.perf_counter()
            self._round_seconds += now - begun
            if self._part == 0:
                self._choose_work(self._round_seconds / 4**self._part_bits / seconds)
                self._round_seconds = 0.0
            if now > end:
                break

    def _choose_work(self, share: float) -> None:
        """How much the next runs do at once; the last ones took a share of the time there is for a turn each."""
        if self._at_once > 1 and share > 1:
            self._at_once //= 2
        elif self._part_bits and share < 0.2 or share > 1:
            fit = self._part_bits + math.ceil(math.log(max(share, 1e-6), 4))    # parts of a turn each
            self._part_bits = min(max(fit, 0), _MOST_PART_BITS)
        elif share < 0.2:
            self._at_once = min(self._at_once * 2, self.most_at_once)

    def advance(self, slices: int) -> None:
        """Add so many slices, or what is left of them, at all pixels."""
        while self._part:       # what `advance_for` has begun
            self._advance(self._at_once)
        self._part_bits, goal = 0, min(self.slices_done + slices, self.slices_wanted)
        while self.slices_done < goal:
            self._advance(min(goal - self.slices_done, self.most_at_once))

    def _advance(self, slices: int) -> None:
        """One run of the shader: some slices, at those pixels whose turn it is."""
        slices = min(slices, self.slices_wanted - self.slices_done)
        targets, runner = self._targets, self._renderer.runner
        targets.swap_histories()
        names = self._names
        inputs = self._sources() | {f"{name}_before": targets.texture(f"{name}@previous") for name in names}
        reads = [("surface", "surface"), ("receivers", "surface"), ("radiance", "rgb9e5"),
                 *((f"{name}_before", _TEXEL) for name in names)]
        defines = [switch("FORM_FACTOR", self._renderer.settings.form_factor, ("disc", "point"))]
        uniforms = {"texel": float(2**self._level), **self._begin(), "senders": self._senders, "bits": self._bits,
                    "first_slice": self.slices_done, "slices": slices, "part": self._part,
                    "fresh": int(self.slices_done == 0 and self._part == 0), "part_bits": self._part_bits,
                    "one": 1.0}
        types = {"texel": "float", "first": "ivec2", "first_sender": "ivec2", "senders": "ivec2", "bits": "int",
                 "first_slice": "int", "slices": "int", "fresh": "int", "part": "int", "part_bits": "int",
                 "one": "float"}
        if self._pixels:
            reads.append(("motion", "rgba16f"))
            inputs["motion"] = runner.targets.texture("motion")
            defines.append(("TRIANGLE_NORMALS", ""))
        tables: tuple[tuple[str, str], ...] = ()
        if self._triangles is not None:
            reads.append(("ends", _TEXEL))
            inputs |= {"ends": self._ends.texture("ends", self._level)} | self._triangles.textures
            tables = tuple(self._triangles.kinds.items())
            defines += [("RAYS", ""), ("LIFT", f"{LIFT:.9f}"), *([("MASKED", "")] if self._triangles.masked else [])]
            uniforms["node_count"], types["node_count"] = self._triangles.node_count, "int"
        variant = Variant("reference/sum.glsl", tuple(reads), tables, tuple((name, _TEXEL) for name in names),
                          tuple(types.items()), tuple(defines))
        runner.unbind()
        runner.shade(variant, targets, inputs, {name: targets.texture(name) for name in names}, uniforms)
        self._part = (self._part + 1) % 4**self._part_bits
        if self._part == 0:
            self.slices_done += slices

    def _sources(self) -> dict[str, moderngl.Texture]:
        targets = self._renderer.runner.targets
        return {"surface": targets.texture("surface", self._level), "receivers": targets.texture("surface"),
                "radiance": targets.texture("radiance", self._level)}

    def _begin(self) -> dict[str, tuple[int, int]]:
        """Where the image begins in what was rendered, in pixels and in texels of the senders' level."""
        band = self._renderer.runner.band
        return {"first": band, "first_sender": (band[0] >> self._level, band[1] >> self._level)}

    def _find_ends(self) -> None:
        renderer, level = self._renderer, self._level
        if self._ends is None or not self._ends.has("ends", level):
            if self._ends is not None:
                self._ends.release()
            self._ends = TargetSet(renderer.context, renderer.size, renderer.settings,
                                   {"ends": Target(_TEXEL, "", "start" if level else "image", cropped=True)})
        sources = self._sources()
        variant = Variant("reference/ends.glsl", (("surface", "surface"), ("receivers", "surface")), (),
                          (("ends", _TEXEL),), (("side", "int"), ("first", "ivec2"), ("first_sender", "ivec2"),
                                                ("image_size", "ivec2")))
        renderer.runner.unbind()
        renderer.runner.shade(variant, self._ends, {name: sources[name] for name in ("surface", "receivers")},
                              {"ends": self._ends.texture("ends", level)},
                              {"side": 2**level, **self._begin(), "image_size": renderer.size})

    # -- results -------------------------------------------------------------------------------------------------------

    @property
    def targets(self) -> TargetSet:
        """Owner of `texture()`."""
        return self._targets

    def texture(self, unoccluded: bool = False) -> moderngl.Texture:
        """The estimate so far, computed anew: RGBA32F, irradiance in W m^-2. It has the guard band, as the renderer's
        own has, and is 0 there.

        Args:
            unoccluded: R1, also where rays were cast for R2.
        """
        names, runner = self._names[:2] if unoccluded else self._names, self._renderer.runner
        reads = (*((name, _TEXEL) for name in names), ("albedo", "reflectance"))
        variant = Variant("reference/resolve.glsl", reads, (), (("reference", _TEXEL),),
                          (("first", "ivec2"), ("slices", "float")))
        inputs = {name: self._targets.texture(name) for name in names} | {"albedo": runner.targets.texture("albedo")}
        reference = self._targets.texture("reference")
        runner.unbind()
        runner.shade(variant, self._targets, inputs, {"reference": reference},
                     {"first": runner.band, "slices": float(self.slices)})
        return reference

    def read(self, unoccluded: bool = False) -> np.ndarray:
        """The estimate so far: (H, W, 3) float32, row 0 = top, W m^-2. Negative where R2's rays are too few.

        Args:
            unoccluded: As of `texture`.
        """
        width, height = self._renderer.size
        left, bottom = self._renderer.runner.band
        texture = self.texture(unoccluded)
        data = np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)
        self._renderer.timers.disturb()
        return np.ascontiguousarray(data[bottom:bottom + height, left:left + width, :3][::-1])

    @property
    def bytes(self) -> int:
        """Of graphics memory."""
        declared = {name: Target(_TEXEL, "", history=True, cropped=True) for name in self._names}
        images = sum(target_bytes(self._renderer.size, self._renderer.settings, declared).values())
        tables = self._triangles.textures.values() if self._triangles else ()
        return images + texture_bytes(self._targets.texture("reference")) + sum(map(texture_bytes, tables))

    def _release_targets(self) -> None:
        for owned in (self._targets, self._ends):
            if owned is not None:
                owned.release()
        self._targets = self._ends = None

    def release(self) -> None:
        """Free all GPU memory."""
        self._release_targets()
        if self._triangles is not None:
            self._triangles.release()
            self._triangles = None
