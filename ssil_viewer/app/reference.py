"""A reference in the window: it converges while one looks, and begins anew when view, light or what it needs change.

Textures exist while a reference is switched on and no longer.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from typing import Any

import moderngl
import numpy as np

from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.gpu.triangle_tables import TriangleTables
from ssil_viewer.headless import read_display
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference import metrics
from ssil_viewer.reference.gpu_pictures import ReferencePictures, Scale
from ssil_viewer.reference.gpu_sums import ProgressiveReference
from ssil_viewer.scene.model import Scene
from ssil_viewer.settings import Settings, of_display

BLOCK = 8
"""Side of the squares whose means the numbers compare, as `ssil-viewer compare` does."""

_TURN = 0.2             # s of work a turn
_BUSY_TURN = 0.03       # s while somebody's hand is on the mouse
_NUMBERS_INTERVAL = 1.0  # s; reading back waits for the GPU
_WITHOUT_EFFECT = (
    "samples", "radius", "sample_spacing", "visibility", "thickness", "visibility_rays", "voxel_fill", "voxel_slices",
    "glossy_samples", "importance_sampling", "upsampling", "temporal", "temporal_frames", "seed", "unseen_from",
    *of_display(Settings()))
"""Settings that change our own light or its display, but neither what is seen nor what it sends."""


@dataclass(frozen=True)
class Numbers:
    """How far the picture is from the reference.

    Attributes:
        bias, relative_rmse, correlation: Over means of 8x8 pixels; None where they mean nothing.
        mean: Of the reference over the image, W m^-2.
    """

    bias: float | None
    relative_rmse: float | None
    correlation: float | None
    mean: float


class WindowReference:
    """The reference of the window's renderer.

    Attributes:
        numbers: Of the last look; None before the first.
    """

    def __init__(self, state: AppState, renderer: Renderer) -> None:
        self._state, self._renderer = state, renderer
        self._sums: ProgressiveReference | None = None
        self._pictures: ReferencePictures | None = None
        self._tables: TriangleTables | None = None
        self._tables_of: Scene | None = None
        self._builder: threading.Thread | None = None
        self._built: list[Any] = []
        self._key: Any = None
        self._looked_at = 0.0
        self._stale = False
        self.numbers: Numbers | None = None

    @property
    def on(self) -> bool:
        """Whether a reference is wanted."""
        return self._state.reference != "off"

    @property
    def preparing(self) -> bool:
        """Whether the triangles are being sorted for R2."""
        return self._builder is not None

    @property
    def sums(self) -> ProgressiveReference | None:
        """What converges; None while there is nothing to."""
        return self._sums

    @property
    def scale(self) -> Scale:
        """Of the error's colours."""
        state = self._state
        return Scale(state.error_limit, state.error_signed, BLOCK if state.error_blocks else 1)

    @property
    def shown(self) -> bool:
        """Whether the window shows a picture of the reference."""
        return self._sums is not None and self._sums.slices_done > 0 and self._state.buffer is None

    @property
    def working(self) -> bool:
        """Whether there is more to do."""
        return self.on and (self.preparing or (self._sums is not None and (self._stale or not self._sums.done)))

    def settings(self, settings: Settings) -> Settings:
        """What the renderer gets: one bounce of what the image shows while a reference is on, as references have."""
        return replace(settings, bounces=1, feedback=False, unseen_samples=0) if self.on else settings

    # -- once a turn ---------------------------------------------------------------------------------------------------

    def follow(self, view: Any) -> None:
        """Tell what the renderer's last frame shows. Begins, begins anew, or ends.

        Args:
            view: As `RendererFollower.look` answers it: settings, lights, the buffer that is shown, and more;
                settings B last.
        """
        if not self.on:
            self.release()
            return
        settings, lights, _, *rest, _ = view
        key = (replace(settings, **{name: getattr(Settings(), name) for name in _WITHOUT_EFFECT}), lights,
               *rest)
        try:
            if self._sums is None or self._sums.kind != self._state.reference or self._tables_stale():
                self._begin()
            elif key != self._key:
                self._sums.restart()
                self._forget_numbers()
            self._key = key
        except (UserError, ShaderError) as error:
            self._give_up(str(error))

    def _tables_stale(self) -> bool:
        return self._state.reference == "R2" and self._tables_of is not self._renderer.scene

    def _begin(self) -> None:
        if self._tables_stale() and not self._build():
            return
        if self._sums is not None:
            self._sums.release()
            self._sums = None
        self._forget_numbers()
        tables = self._tables if self._state.reference == "R2" else None
        self._sums = ProgressiveReference(self._renderer, self._state.reference, tables=tables)
        if self._pictures is None:
            self._pictures = ReferencePictures(self._renderer)

    def _build(self) -> bool:
        """Sorts the scene's triangles in a thread; whether they are there."""
        scene, origin = self._renderer.scene, self._renderer.origin

        def build() -> None:
            try:
                self._built.append((scene, TriangleTables.of(scene, origin)))
            except UserError as error:
                self._built.append((scene, error))
            except Exception as error:  # a fault must end the reference, not the window
                self._built.append((scene, UserError("rays: tables cannot be made", scene.name,
                                                     f"{type(error).__name__}: {error}")))

        if self._builder is None:
            if self._sums is not None:      # of another kind or scene
                self._sums.release()
                self._sums = None
                self._forget_numbers()
            self._builder = threading.Thread(target=build, daemon=True)
            self._builder.start()
            return False
        if self._builder.is_alive():
            return False
        self._builder = None
        (built_of, made), self._built = self._built[-1], []
        if isinstance(made, UserError):
            raise made
        self._tables_of, self._tables = built_of, made
        return built_of is scene

    def _give_up(self, why: str) -> None:
        self._state.reference = "off"
        self._state.say(why, "error")
        self.release()

    def advance(self, busy: bool, rendered: bool) -> None:
        """Go on for a while. Call after `follow`, when the renderer's last frame shows the view.

        Args:
            busy: The user does something, or frames are to come one after the other: be back soon.
            rendered: Our own picture is a new one.
        """
        if self._sums is None:
            return
        try:
            self._stale |= rendered or not self._sums.done
            self._sums.advance_for(_BUSY_TURN if busy else _TURN)
            now = time.monotonic()
            if self._stale and now - self._looked_at > _NUMBERS_INTERVAL and self._sums.slices_done:
                self._looked_at, self._stale = now, False
                self._look()
        except (UserError, ShaderError) as error:
            self._give_up(str(error))

    def _forget_numbers(self) -> None:
        self.numbers, self._looked_at = None, 0.0

    def _look(self) -> None:
        renderer = self._renderer
        visible = renderer.read("view_depth") > 0
        truth = self._sums.read()
        ours, theirs = (metrics.block_means(image, visible, BLOCK) for image in (renderer.read("indirect"), truth))
        mean = float(truth[visible].mean(dtype=np.float64)) if visible.any() else 0.0
        found = metrics.agreement(ours, theirs) if len(theirs) else dict.fromkeys(
            ("bias", "relative_rmse", "correlation"))
        self.numbers = Numbers(**found, mean=mean)

    # -- what is shown -------------------------------------------------------------------------------------------------

    def present(self, framebuffer: moderngl.Framebuffer) -> None:
        """Draw it over the picture: the part right of the divider, or all of it."""
        if not self.shown:
            return
        try:
            picture = self._picture()
        except (UserError, ShaderError) as error:
            self._give_up(str(error))
            return
        self._renderer.present(framebuffer, picture, self._state.split if self._state.split_view else 0.0)

    def _picture(self) -> moderngl.Texture:
        if self._state.reference_view == "error":
            return self._pictures.error(self._sums, self.numbers.mean if self.numbers else 1.0, self.scale)
        return self._pictures.image(self._sums)

    def read(self) -> np.ndarray:
        """The picture as it is shown, in the rendered size: (H, W, 3) uint8, row 0 = top."""
        ours = read_display(self._renderer)
        if not self.shown:
            return ours
        self._picture()
        theirs = self._pictures.read()
        column = round(self._state.split * ours.shape[1]) if self._state.split_view else 0
        return np.concatenate([ours[:, :column], theirs[:, column:]], 1)

    def release(self) -> None:
        """Free all GPU memory, and the sorted triangles."""
        for owned in (self._sums, self._pictures):
            if owned is not None:
                owned.release()
        self._sums = self._pictures = self._tables = self._tables_of = self._key = None
        self._forget_numbers()
