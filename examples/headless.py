"""Render a scene without a window to NumPy arrays, and save them: python examples/headless.py [SCENE]"""

import sys

import numpy as np
from PIL import Image

import ssil_viewer


def main(scene="builtin:cornell", stem="headless", size=(640, 360), frames=16):
    settings = ssil_viewer.Settings(samples=64, start_level=1)
    images = ssil_viewer.render(ssil_viewer.load_scene(scene), size=size, settings=settings, frames=frames)
    # Float arrays, row 0 = top: final = direct + albedo / pi * indirect, and everything on the way there
    for name in ("final", "direct", "albedo", "indirect"):
        print(f"{name:9} {images[name].shape}  mean {images[name].mean():.4f}")
    np.savez(f"{stem}.npz", **images)
    Image.fromarray(images["display"]).save(f"{stem}.png")  # tone-mapped, sRGB
    return images


if __name__ == "__main__":
    main(*sys.argv[1:2])
