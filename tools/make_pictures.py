"""Makes every picture of the documentation with the program itself: `make pictures`, or names of pictures to make.

Each function of `PICTURES` makes one file below docs/images. The same machine and driver give the same bytes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Callable

import numpy as np
from PIL import Image

from ssil_viewer.reference.gpu_pictures import ReferencePictures, Scale
from ssil_viewer.reference.gpu_sums import ProgressiveReference
from ssil_viewer.reference.whole_image import legend
from ssil_viewer.reproduce.studio import FRAMES, Studio, tile
from ssil_viewer.scene.environment import load_environment
from ssil_viewer.scene.texels import linear_from_srgb

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "images"
SIZE = (1280, 720)


def hero(studio: Studio) -> Image.Image:
    """One view three times: direct light, indirect light, both."""
    studio.aim("builtin:atrium", "nave")
    studio.render(samples=128, exposure=0.5, antialias=True)
    both = studio.picture()
    panels = [("direct light", studio.picture("direct")), ("indirect light", studio.picture("indirect")),
              ("both", both)]
    return tile(panels, 3, (420, 540), (360, 0, 920, 720))


def shadows(studio: Studio) -> Image.Image:
    """Direct light alone."""
    studio.aim("builtin:atrium", "gallery")
    studio.render(frames=1, bounces=0, antialias=True)
    return tile([("direct light with shadows", studio.picture())], 1, (800, 450), (0, 180, 960, 720))


def gbuffer(studio: Studio) -> Image.Image:
    """Four of the G-buffer's contents."""
    studio.aim("builtin:atrium", "nave")
    studio.render(frames=1)
    names = ("view_depth", "normal", "albedo", "roughness")
    return tile([(name, studio.buffer(name)) for name in names], 2, (480, 270))


def direct(studio: Studio) -> Image.Image:
    """What the camera sees beside what the gather reads."""
    studio.aim("builtin:glossy", "front")
    studio.render(frames=1)
    return tile([("direct: with highlights", studio.buffer("direct")),
                 ("radiance: what neighbours receive", studio.buffer("radiance"))], 2, (480, 270),
                (120, 170, 920, 620))


def mipmap(studio: Studio) -> Image.Image:
    """Normals of level 4 under the three filters."""
    studio.aim("builtin:atrium", "nave")
    panels = []
    for choice in ("vote", "nearest", "average"):
        studio.render(frames=1, mip_filter=choice)
        panels.append((choice, studio.buffer("normal", 4)))
    studio.render(frames=1)
    return tile([("level 0", studio.buffer("normal")), *panels], 2, (480, 360), (0, 60, 720, 600), sharp=True)


def gather(studio: Studio) -> Image.Image:
    """The light of each level, as gathered."""
    studio.aim("builtin:atrium", "nave")
    studio.render(frames=1, temporal=False)
    return tile([(f"level {level}", studio.buffer("gather", level)) for level in (2, 3, 4, 5)], 2, (480, 270),
                sharp=True)


def form_factor(studio: Studio) -> Image.Image:
    """Spacing of the samples and form factor, one frame."""
    studio.aim("builtin:cornell", "front")
    panels = []
    for spacing, form in (("radius", "disc"), ("area", "disc"), ("area", "point")):
        studio.render(frames=1, temporal=False, sample_spacing=spacing, form_factor=form, show="indirect", exposure=1.0)
        panels.append((f"even in {spacing}, {form}", studio.picture()))
    return tile(panels, 3, (420, 420), (280, 0, 1000, 720))


def unseen(studio: Studio) -> Image.Image:
    """Indirect light from what the image shows, and from all."""
    studio.aim("builtin:atrium", "nave")
    panels = []
    for samples, name in ((0, "what the image shows"), (2, "with unseen light")):
        studio.render(show="indirect", exposure=1.0, unseen_samples=samples)
        panels.append((name, studio.picture()))
    return tile(panels, 2, (480, 270))


def upsample(studio: Studio) -> Image.Image:
    """Nearest and bilateral upsampling."""
    studio.aim("builtin:atrium", "hanging")
    panels = []
    for choice in ("nearest", "bilateral"):
        studio.render(frames=1, temporal=False, upsampling=choice, show="indirect")
        panels.append((choice, studio.picture()))
    return tile(panels, 2, (480, 480), (400, 200, 880, 680))


def temporal(studio: Studio) -> Image.Image:
    """Without and with the temporal filter, few samples."""
    studio.aim("builtin:atrium", "hanging")
    studio.render(frames=1, temporal=False, show="indirect", samples=8)
    off = studio.picture()
    studio.render(temporal=True, show="indirect", samples=8)
    return tile([("off, 8 samples", off), (f"on, 8 samples, frame {FRAMES}", studio.picture())], 2, (480, 480),
                (400, 200, 880, 680))


def visibility(studio: Studio) -> Image.Image:
    """Indirect light behind a cube and an arch under the three modes."""
    studio.aim("builtin:arch", "front")
    panels = []
    for choice in ("off", "horizon", "voxel"):
        studio.render(visibility=choice, show="indirect", exposure=1.5)
        panels.append((choice, studio.picture()))
    return tile(panels, 3, (420, 236))


def error(studio: Studio) -> Image.Image:
    """Where the three visibility modes err in the Cornell box."""
    studio.aim("builtin:cornell", "front", (427, 240))
    scale = Scale(0.5)
    panels, reference, pictures = [], None, None
    try:
        for mode in ("off", "horizon", "voxel"):
            studio.render(visibility=mode)
            if reference is None:       # it does not depend on the mode
                reference, pictures = ProgressiveReference(studio.renderer, "R2"), ReferencePictures(studio.renderer)
                reference.advance(reference.slices_wanted)
            seen = studio.values("view_depth") > 0
            pictures.error(reference, float(reference.read()[seen].mean()), scale)
            panels.append((mode, Image.fromarray(pictures.read())))
    finally:
        for owned in (reference, pictures):
            if owned is not None:
                owned.release()
    sheet = tile(panels, 3, (321, 360), (107, 0, 321, 240))
    key = legend(sheet.width, scale, "ours - R2, relative to the mean of R2; irradiance of one bounce")
    return Image.fromarray(np.concatenate([np.asarray(sheet), key]))


def bounces(studio: Studio) -> Image.Image:
    """The first three bounces, each on its own, and their sum."""
    studio.aim("builtin:cornell", "front")
    studio.render(bounces=4, start_level=1, levels=5, samples=256)
    panels = [(f"bounce {bounce}", studio.buffer(f"bounce_{bounce}")) for bounce in (1, 2, 3)]
    return tile([*panels, ("direct and four bounces", studio.picture("both"))], 4, (315, 315), (280, 0, 1000, 720))


def relief(studio: Studio) -> Image.Image:
    """A relief that no direct light reaches."""
    studio.aim("builtin:atrium", "relief")
    studio.render(antialias=True)
    both = studio.picture()
    return tile([("direct light", studio.picture("direct")), ("indirect light", studio.picture("indirect")),
                 ("both", both)], 3, (420, 236))


def tone_map(studio: Studio) -> Image.Image:
    """The four tone curves."""
    studio.aim("builtin:atrium", "hanging")
    studio.render()
    panels = []
    for choice in ("neutral", "aces", "reinhard", "linear"):
        studio.render(frames=4, tone_map=choice, antialias=True)
        panels.append((choice, studio.picture()))
    return tile(panels, 2, (420, 236))


def sky(studio: Studio) -> Image.Image:
    """The sun alone, the sun with a clear sky, and the overcast one without the sun."""
    studio.aim("builtin:atrium", "nave")
    own, panels = studio.renderer.lights, []
    try:
        for name, title, exposure in (("", "the scene's sun", 0.5), ("builtin:sky", "with builtin:sky", -0.5),
                                      ("builtin:overcast", "builtin:overcast alone", 0.5)):
            studio.renderer.set_environment(load_environment(name) if name else None)
            studio.renderer.set_lights(() if "overcast" in name else own)
            studio.render(exposure=exposure, antialias=True)
            panels.append((title, studio.picture()))
    finally:
        studio.renderer.set_environment(None)
        studio.renderer.set_lights(own)
    return tile(panels, 3, (420, 540), (360, 0, 920, 720))


def antialias(studio: Studio) -> Image.Image:
    """Edges as they are, smoothed, and as the mean of 4x4 pixels each."""
    left, top, right, bottom = 800, 90, 940, 210
    panels = []
    for choice in (False, True):
        studio.aim("builtin:atrium", "nave")
        studio.render(antialias=choice)
        name = "with antialiasing" if choice else "without antialiasing"
        panels.append((name, studio.picture().crop((left, top, right, bottom))))
    studio.aim("builtin:atrium", "nave", (4 * SIZE[0], 4 * SIZE[1]))
    studio.render(frames=1)
    light = linear_from_srgb(np.asarray(studio.picture().crop((4 * left, 4 * top, 4 * right, 4 * bottom))))
    mean = light.reshape(bottom - top, 4, right - left, 4, 3).mean((1, 3))
    codes = np.arange(256)
    shown = np.interp(mean, linear_from_srgb(codes), codes)
    panels.append(("mean of 4x4 pixels", Image.fromarray(np.uint8(shown + 0.5))))
    return tile(panels, 3, (420, 360), sharp=True)


PICTURES: dict[str, Callable[[Studio], Image.Image]] = {
    "hero.png": hero, "shadows.jpg": shadows, "gbuffer.jpg": gbuffer, "direct.jpg": direct, "mipmap.png": mipmap,
    "gather.png": gather, "form-factor.jpg": form_factor, "unseen.jpg": unseen, "upsample.jpg": upsample,
    "temporal.jpg": temporal, "relief.jpg": relief, "visibility.jpg": visibility, "bounces.jpg": bounces,
    "error.jpg": error, "tone-map.jpg": tone_map, "antialias.png": antialias,
    "sky.jpg": sky,
}


def main() -> int:
    """Makes the pictures named on the command line, or all."""
    wanted = sys.argv[1:] or list(PICTURES)
    if unknown := [name for name in wanted if name not in PICTURES]:
        print(f"no picture is called {unknown[0]!r}; choose from {', '.join(PICTURES)}", file=sys.stderr)
        return 2
    FOLDER.mkdir(parents=True, exist_ok=True)
    studio = Studio(SIZE)
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
