"""Everything the window remembers, as plain data. Events and panels change it; the frame reads it."""

from __future__ import annotations

import statistics
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ssil_viewer.app.camera_control import CameraControl
from ssil_viewer.app.light_motion import LightMotion
from ssil_viewer.scene.model import Camera, Light, Scene
from ssil_viewer.settings import Settings
from ssil_viewer.text import showable

ReferenceKind = Literal["off", "R1", "R2"]

_TOAST_SECONDS = {"info": 4.0, "error": 10.0}
_MOST_TOASTS = 5
_FRAMES_KEPT = 30


@dataclass(frozen=True)
class Toast:
    """A message that goes away by itself.

    Attributes:
        until: `time.monotonic()` at which it goes.
        topic: A newer message on the same one takes its place; empty: it stays beside all others.
    """

    text: str
    kind: Literal["info", "error"]
    until: float
    topic: str = ""


@dataclass(frozen=True)
class PixelReading:
    """Values under the cursor.

    Attributes:
        x, y: Pixel of the image, row 0 = top.
        values: Buffer name to its channels.
    """

    x: int
    y: int
    values: dict[str, tuple[float, ...]]


@dataclass
class AppState:
    """The state of the window.

    Attributes:
        settings: What the user wants; the renderer follows at the next frame, or once what they need is there.
        bounds: Corners of the scene's box; see Scene.bounds.
        home: Camera that the scene was opened with.
        home_is_given: The user asked for just that view, so no panel moves it aside.
        lights: The lights as edited, without their motion.
        preparing: What is made for the next frame or for new settings and takes long, or empty; see `Preparation`.
        buffer: Name of the buffer shown in place of the image, or None.
        level: Mip level of that buffer.
        other: Settings B, shown right of the divider, or None.
        reference: Which sum our light is compared with.
        reference_view: What is shown of it: the image under its light, or our error.
        split_view: It is shown right of a divider, and our picture left of it; otherwise everywhere.
        split: Where the divider is, as a share of the window's width.
        error_limit: Relative error at the end of the colour scale.
        error_signed: The scale tells too dark from too bright.
        error_blocks: Errors of means of 8x8 pixels, otherwise of pixels.
        ui_scale: Size of text and panels on top of what the monitor asks for.
        covered: Share of the window's width that the panel lies on.
        render_scale: Rendered pixels per framebuffer pixel along each side.
        shader_error: What the compiler said at the last reload, or empty.
        no_indirect: Why there is no indirect light, or empty.
        continuous: Render every turn of the loop, also while nothing changes.
        resting: Nothing changes and nothing is rendered.
        shader_generation: Counts reloads of the shaders.
        frame_seconds: Wall time of the last frames.
    """

    settings: Settings
    scene: Scene
    home: Camera
    home_is_given: bool = False
    bounds: tuple[np.ndarray, np.ndarray] = field(default_factory=lambda: (np.zeros(3), np.zeros(3)))
    camera: CameraControl = field(default_factory=CameraControl)
    lights: tuple[Light, ...] = ()
    motion: LightMotion = field(default_factory=LightMotion)
    buffer: str | None = None
    level: int = 0
    inspector: bool = False
    pixel: PixelReading | None = None
    other: Settings | None = None
    reference: ReferenceKind = "off"
    reference_view: Literal["image", "error"] = "image"
    split_view: bool = True
    split: float = 0.6
    error_limit: float = 0.5
    error_signed: bool = True
    error_blocks: bool = False
    panels_visible: bool = True
    timings_visible: bool = True
    help_open: bool = False
    about_open: bool = False
    ui_scale: float = 1.0
    covered: float = 0.0
    render_scale: float = 1.0
    vsync: bool = True
    continuous: bool = True
    resting: bool = False
    shader_generation: int = 0
    loading: str | None = None
    preparing: str = ""
    shader_error: str = ""
    no_indirect: str = ""
    toasts: list[Toast] = field(default_factory=list)
    frame_seconds: deque[float] = field(default_factory=lambda: deque(maxlen=_FRAMES_KEPT))

    def open_scene(self, scene: Scene, camera: Camera, camera_is_given: bool = False) -> None:
        """Take over a new scene; the camera of the old one would mean nothing in it."""
        self.scene, self.home, self.home_is_given = scene, camera, camera_is_given
        self.lights = scene.lights
        self.motion = LightMotion()
        self.bounds = scene.bounds()
        self.camera.set_scene_size(*self.bounds)
        self.camera.viewpoints, self.camera.asides = dict(enumerate(scene.cameras[:9], start=1)), {}
        self.camera.set_camera(camera)

    @property
    def scene_title(self) -> str:
        """The scene's name, of a file without its folder."""
        return showable(self.scene.name.replace("\\", "/").rstrip("/").rpartition("/")[2])

    def say(self, text: str, kind: Literal["info", "error"] = "info", topic: str = "") -> None:
        """Show a message for a while, in place of the last one on its topic; the same again only stays longer."""
        text = showable(text)
        others = [toast for toast in self.toasts if toast.text != text and (not topic or toast.topic != topic)]
        self.toasts = others[-(_MOST_TOASTS - 1):]
        self.toasts.append(Toast(text, kind, time.monotonic() + _TOAST_SECONDS[kind], topic))

    def drop_old_toasts(self) -> None:
        """Forget messages whose time is over."""
        now = time.monotonic()
        self.toasts = [toast for toast in self.toasts if toast.until > now]

    @property
    def frame_time(self) -> float:
        """Median wall time of the last frames in seconds; 0 before the first."""
        return statistics.median(self.frame_seconds) if self.frame_seconds else 0.0
