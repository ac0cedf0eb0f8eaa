"""Renders views of scenes, one after the other, and lays pictures side by side: for reports and documentation."""

from __future__ import annotations

import dataclasses
from typing import Iterable

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.headless import read_display, render_frames
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.load import load_scene
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings

FRAMES = 16
"""After so many the temporal filter has settled; `render` takes as many."""

Box = tuple[int, int, int, int]
"""Left, upper, right, lower in pixels of a 1280x720 image."""

_SIZE = (1280, 720)

RAW = Settings(antialias=False)
"""Pictures that show each pixel as the method made it: blocks, noise and edges are what they are for."""


class Studio:
    """One renderer that goes from scene to scene.

    Args:
        size: Of all pictures, unless `resize` changes it.
        base: What settings start from; edges are not smoothed by default.

    Attributes:
        renderer: Has the scene of the last `aim`.
        camera: Of the last `aim`.

    Raises:
        UserError: No OpenGL, or the size does not fit.
    """

    def __init__(self, size: tuple[int, int], base: Settings = RAW) -> None:
        self._context = create_headless_context()
        self.base, self.size = base, size
        try:
            self.renderer = Renderer(self._context, size, base)
        except BaseException:
            self._context.release()
            raise
        self.camera: Camera | None = None
        self._loaded: dict[str, Scene] = {}

    def aim(self, scene: str, camera: str = "", size: tuple[int, int] | None = None) -> None:
        """Choose a scene, one of its cameras (its first view without a name) and a size; the history begins anew.

        Args:
            scene: As in --scene of the command line.
        """
        if scene not in self._loaded:
            self._loaded[scene] = load_scene(scene)
        found = self._loaded[scene]
        if self.renderer.scene is not found:
            self.renderer.set_scene(found)
        self.renderer.resize(size or self.size)
        self.camera = next(c for c in found.cameras if c.name == camera) if camera else default_camera(found)
        self.renderer.reset_history()

    def settings(self, **changes: object) -> Settings:
        """The base settings but for `changes`."""
        return dataclasses.replace(self.base, **changes)

    def set(self, **changes: object) -> Renderer:
        """Set the base settings but for `changes`, and forget the history; returns the renderer."""
        self.renderer.set_settings(self.settings(**changes))
        self.renderer.reset_history()
        self.renderer.show_buffer(None)
        return self.renderer

    def render(self, frames: int = FRAMES, **changes: object) -> None:
        """Render with the base settings but for `changes`."""
        render_frames(self.set(**changes), self.camera, frames)

    def picture(self, show: str | None = None) -> Image.Image:
        """The picture; `show` renders one more frame with that light."""
        if show is not None:
            self.renderer.set_settings(dataclasses.replace(self.renderer.settings, show=show))
            self.renderer.render(self.camera)
        return Image.fromarray(read_display(self.renderer))

    def buffer(self, name: str, level: int = 0) -> Image.Image:
        """A buffer as the inspector shows it, after one more frame."""
        self.renderer.show_buffer(name, level)
        self.renderer.render(self.camera)
        image = Image.fromarray(read_display(self.renderer))
        self.renderer.show_buffer(None)
        return image

    def values(self, name: str, level: int = 0) -> np.ndarray:
        """Values of a buffer of the last frame."""
        return self.renderer.read(name, level)

    def close(self) -> None:
        """Free everything."""
        self.renderer.release()
        self._context.release()


def label(image: Image.Image, text: str) -> Image.Image:
    """A copy with a caption in the lower left corner."""
    image = image.convert("RGB")
    draw = ImageDraw.Draw(image, "RGBA")
    font = ImageFont.load_default(size=15)
    left, top, right, bottom = draw.textbbox((0, 0), text, font=font)
    width, height = right - left + 16, bottom - top + 12
    draw.rectangle((0, image.height - height, width, image.height), fill=(0, 0, 0, 170))
    draw.text((8 - left, image.height - height + 6 - top), text, font=font, fill=(255, 255, 255))
    return image


def scaled_box(box: Box, size: tuple[int, int]) -> Box:
    """The same part of an image of another size, whose camera has the same vertical field of view and middle."""
    scale = size[1] / _SIZE[1]
    left, upper, right, lower = box
    left, right = (size[0] / 2 + (edge - _SIZE[0] / 2) * scale for edge in (left, right))
    return round(left), round(upper * scale), round(right), round(lower * scale)


def tile(panels: Iterable[tuple[str, Image.Image]], columns: int, size: tuple[int, int], crop: Box | None = None,
         sharp: bool = False) -> Image.Image:
    """Labelled panels of one size in rows, with thin dividers.

    Args:
        crop: Part of each panel that is used, as `scaled_box` takes it.
        sharp: Enlarge without smoothing, so that texels can be seen.
    """
    scaled = []
    for text, image in panels:
        part = image.crop(scaled_box(crop, image.size)) if crop else image
        method = Image.Resampling.NEAREST if sharp else Image.Resampling.LANCZOS
        scaled.append(label(part.resize(size, method), text))
    rows = -(-len(scaled) // columns)
    gap = 3
    sheet = Image.new("RGB", (columns * (size[0] + gap) - gap, rows * (size[1] + gap) - gap), (255, 255, 255))
    for at, panel in enumerate(scaled):
        sheet.paste(panel, ((at % columns) * (size[0] + gap), (at // columns) * (size[1] + gap)))
    return sheet
