"""Makes every picture of the documentation with the program itself: `make pictures`, or names of pictures to make.

Each function of `PICTURES` makes one file below docs/images. The same machine and driver give the same bytes.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Callable, Iterable

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.headless import read_display, render_frames
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference.gpu_pictures import ReferencePictures, Scale
from ssil_viewer.reference.gpu_sums import ProgressiveReference
from ssil_viewer.reference.whole_image import legend
from ssil_viewer.scene.load import load_scene
from ssil_viewer.scene.model import Camera
from ssil_viewer.settings import Settings

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "images"
SIZE = (1280, 720)
FRAMES = 16
DEFAULTS = Settings()
# Left, upper, right, lower in pixels of a 1280x720 image
Box = tuple[int, int, int, int]


class Studio:
    """Renders views of the built-in scenes, one scene at a time."""

    def __init__(self) -> None:
        self._context = create_headless_context()
        self._renderer = Renderer(self._context, SIZE, DEFAULTS)
        self._scene_name = ""
        self._camera: Camera | None = None

    def aim(self, scene: str, camera: str) -> None:
        """Choose a built-in scene and one of its cameras; the history begins anew."""
        if scene != self._scene_name:
            self._renderer.set_scene(load_scene(f"builtin:{scene}"))
            self._scene_name = scene
        self._camera = next(c for c in self._renderer.scene.cameras if c.name == camera)
        self._renderer.reset_history()

    def render(self, frames: int = FRAMES, **settings: object) -> None:
        """Render with the defaults but for `settings`."""
        self._renderer.set_settings(dataclasses.replace(DEFAULTS, **settings))
        self._renderer.reset_history()
        self._renderer.show_buffer(None)
        render_frames(self._renderer, self._camera, frames)

    def picture(self, show: str | None = None) -> Image.Image:
        """The picture; `show` renders one more frame with that light."""
        if show is not None:
            self._renderer.set_settings(dataclasses.replace(self._renderer.settings, show=show))
            self._renderer.render(self._camera)
        return Image.fromarray(read_display(self._renderer))

    def buffer(self, name: str, level: int = 0) -> Image.Image:
        """A buffer as the inspector shows it, after one more frame."""
        self._renderer.show_buffer(name, level)
        self._renderer.render(self._camera)
        image = Image.fromarray(read_display(self._renderer))
        self._renderer.show_buffer(None)
        return image

    def values(self, name: str, level: int = 0) -> np.ndarray:
        """Values of a buffer of the last frame."""
        return self._renderer.read(name, level)

    def errors(self, modes: Iterable[str], size: tuple[int, int], scale: Scale) -> list[tuple[str, Image.Image]]:
        """The error of each visibility mode against R2, as colours, at another size than SIZE."""
        self._renderer.resize(size)
        panels, reference, pictures = [], None, None
        try:
            for mode in modes:
                self.render(visibility=mode)
                if reference is None:       # it does not depend on the mode
                    reference, pictures = ProgressiveReference(self._renderer, "R2"), ReferencePictures(self._renderer)
                    reference.advance(reference.slices_wanted)
                pictures.error(reference, float(reference.read()[self.values("view_depth") > 0].mean()), scale)
                panels.append((mode, Image.fromarray(pictures.read())))
        finally:
            for owned in (reference, pictures):
                if owned is not None:
                    owned.release()
            self._renderer.resize(SIZE)
        return panels

    def close(self) -> None:
        """Free everything."""
        self._renderer.release()
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


def tile(panels: Iterable[tuple[str, Image.Image]], columns: int, size: tuple[int, int], crop: Box | None = None,
         sharp: bool = False) -> Image.Image:
    """Labelled panels of one size in rows, with thin dividers.

    Args:
        crop: Part of each panel that is used.
        sharp: Enlarge without smoothing, so that texels can be seen.
    """
    scaled = []
    for text, image in panels:
        part = image.crop(crop) if crop else image
        method = Image.Resampling.NEAREST if sharp else Image.Resampling.LANCZOS
        scaled.append(label(part.resize(size, method), text))
    rows = -(-len(scaled) // columns)
    gap = 3
    sheet = Image.new("RGB", (columns * (size[0] + gap) - gap, rows * (size[1] + gap) - gap), (255, 255, 255))
    for at, panel in enumerate(scaled):
        sheet.paste(panel, ((at % columns) * (size[0] + gap), (at // columns) * (size[1] + gap)))
    return sheet


def hero(studio: Studio) -> Image.Image:
    """One view three times: direct light, indirect light, both."""
    studio.aim("atrium", "nave")
    studio.render(samples=128, exposure=0.5)
    both = studio.picture()
    panels = [("direct light", studio.picture("direct")), ("indirect light", studio.picture("indirect")),
              ("both", both)]
    return tile(panels, 3, (420, 540), (360, 0, 920, 720))


def shadows(studio: Studio) -> Image.Image:
    """Direct light alone."""
    studio.aim("atrium", "gallery")
    studio.render(frames=1, bounces=0)
    return tile([("direct light with shadows", studio.picture())], 1, (800, 450), (0, 180, 960, 720))


def gbuffer(studio: Studio) -> Image.Image:
    """Four of the G-buffer's contents."""
    studio.aim("atrium", "nave")
    studio.render(frames=1)
    names = ("view_depth", "normal", "albedo", "roughness")
    return tile([(name, studio.buffer(name)) for name in names], 2, (480, 270))


def direct(studio: Studio) -> Image.Image:
    """What the camera sees beside what the gather reads."""
    studio.aim("glossy", "front")
    studio.render(frames=1)
    return tile([("direct: with highlights", studio.buffer("direct")),
                 ("radiance: what neighbours receive", studio.buffer("radiance"))], 2, (480, 270),
                (120, 170, 920, 620))


def mipmap(studio: Studio) -> Image.Image:
    """Normals of level 4 under the three filters."""
    studio.aim("atrium", "nave")
    panels = []
    for choice in ("vote", "nearest", "average"):
        studio.render(frames=1, mip_filter=choice)
        panels.append((choice, studio.buffer("normal", 4)))
    studio.render(frames=1)
    return tile([("level 0", studio.buffer("normal")), *panels], 2, (480, 360), (0, 60, 720, 600), sharp=True)


def gather(studio: Studio) -> Image.Image:
    """The light of each level, as gathered."""
    studio.aim("atrium", "nave")
    studio.render(frames=1, temporal=False)
    return tile([(f"level {level}", studio.buffer("gather", level)) for level in (2, 3, 4, 5)], 2, (480, 270),
                sharp=True)


def form_factor(studio: Studio) -> Image.Image:
    """Spacing of the samples and form factor, one frame."""
    studio.aim("cornell", "front")
    panels = []
    for spacing, form in (("radius", "disc"), ("area", "disc"), ("area", "point")):
        studio.render(frames=1, temporal=False, sample_spacing=spacing, form_factor=form, show="indirect", exposure=1.0)
        panels.append((f"even in {spacing}, {form}", studio.picture()))
    return tile(panels, 3, (420, 420), (280, 0, 1000, 720))


def upsample(studio: Studio) -> Image.Image:
    """Nearest and bilateral upsampling."""
    studio.aim("atrium", "hanging")
    panels = []
    for choice in ("nearest", "bilateral"):
        studio.render(frames=1, temporal=False, upsampling=choice, show="indirect")
        panels.append((choice, studio.picture()))
    return tile(panels, 2, (480, 480), (400, 200, 880, 680))


def temporal(studio: Studio) -> Image.Image:
    """Without and with the temporal filter, few samples."""
    studio.aim("atrium", "hanging")
    studio.render(frames=1, temporal=False, show="indirect", samples=8)
    off = studio.picture()
    studio.render(temporal=True, show="indirect", samples=8)
    return tile([("off, 8 samples", off), (f"on, 8 samples, frame {FRAMES}", studio.picture())], 2, (480, 480),
                (400, 200, 880, 680))


def visibility(studio: Studio) -> Image.Image:
    """Indirect light behind a cube and an arch under the three modes."""
    studio.aim("arch", "front")
    panels = []
    for choice in ("off", "horizon", "voxel"):
        studio.render(visibility=choice, show="indirect", exposure=1.5)
        panels.append((choice, studio.picture()))
    return tile(panels, 3, (420, 236))


def error(studio: Studio) -> Image.Image:
    """Where the three visibility modes err in the Cornell box."""
    studio.aim("cornell", "front")
    scale = Scale(0.5)
    sheet = tile(studio.errors(("off", "horizon", "voxel"), (427, 240), scale), 3, (321, 360), (107, 0, 321, 240))
    key = legend(sheet.width, scale, "ours - R2, relative to the mean of R2; irradiance of one bounce")
    return Image.fromarray(np.concatenate([np.asarray(sheet), key]))


def bounces(studio: Studio) -> Image.Image:
    """The first three bounces, each on its own, and their sum."""
    studio.aim("cornell", "front")
    studio.render(bounces=4, start_level=1, levels=5, samples=256)
    panels = [(f"bounce {bounce}", studio.buffer(f"bounce_{bounce}")) for bounce in (1, 2, 3)]
    return tile([*panels, ("direct and four bounces", studio.picture("both"))], 4, (315, 315), (280, 0, 1000, 720))


def relief(studio: Studio) -> Image.Image:
    """A relief that no direct light reaches."""
    studio.aim("atrium", "relief")
    studio.render()
    both = studio.picture()
    return tile([("direct light", studio.picture("direct")), ("indirect light", studio.picture("indirect")),
                 ("both", both)], 3, (420, 236))


def tone_map(studio: Studio) -> Image.Image:
    """The four tone curves."""
    studio.aim("atrium", "hanging")
    studio.render()
    panels = []
    for choice in ("neutral", "aces", "reinhard", "linear"):
        studio.render(frames=4, tone_map=choice)
        panels.append((choice, studio.picture()))
    return tile(panels, 2, (420, 236))


PICTURES: dict[str, Callable[[Studio], Image.Image]] = {
    "hero.png": hero, "shadows.jpg": shadows, "gbuffer.jpg": gbuffer, "direct.jpg": direct, "mipmap.png": mipmap,
    "gather.png": gather, "form-factor.jpg": form_factor, "upsample.jpg": upsample, "temporal.jpg": temporal,
    "relief.jpg": relief, "visibility.jpg": visibility, "bounces.jpg": bounces, "error.jpg": error,
    "tone-map.jpg": tone_map,
}


def main() -> int:
    """Makes the pictures named on the command line, or all."""
    wanted = sys.argv[1:] or list(PICTURES)
    if unknown := [name for name in wanted if name not in PICTURES]:
        print(f"no picture is called {unknown[0]!r}; choose from {', '.join(PICTURES)}", file=sys.stderr)
        return 2
    FOLDER.mkdir(parents=True, exist_ok=True)
    studio = Studio()
    for name in wanted:
        image = PICTURES[name](studio)
        if name.endswith(".jpg"):
            image.save(FOLDER / name, quality=88, optimize=True)
        else:
            image.save(FOLDER / name, optimize=True)
        print(f"wrote {FOLDER / name}, {(FOLDER / name).stat().st_size // 1024} KiB")
    studio.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
