"""Compares irradiance with the sum over all pixels, unoccluded (R1) and with true visibility by rays (R2).

    .venv/bin/python tools/compare_visibility.py builtin:cornell builtin:arch --samples 256 --frames 16

Prints bias and relative RMSE over means of 8x8 pixels, for each scene, under the flags of `ssil-viewer render`. The
references take 3 to 10 s for 60 blocks at 1280x720 from start level 2.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ssil_viewer.commands import values  # noqa: E402
from ssil_viewer.commands.parser import Parser, add_image_flags  # noqa: E402
from ssil_viewer.commands.shared import camera_of, settings_of  # noqa: E402
from ssil_viewer.errors import UserError  # noqa: E402
from ssil_viewer.gpu.context import create_headless_context  # noqa: E402
from ssil_viewer.headless import render_frames  # noqa: E402
from ssil_viewer.pipeline import Renderer  # noqa: E402
from ssil_viewer.scene import load_scene  # noqa: E402
from tests.reference import bias_and_error, random_blocks  # noqa: E402
from tests.visible_reference import references  # noqa: E402


def main() -> None:
    """Reads the flags and compares scene after scene."""
    parser = Parser("compare_visibility.py", "SCENE... [flags]", __doc__)
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    add_image_flags(parser, "frames rendered before the comparison, default 16")
    compare = parser.add_argument_group("comparison")
    compare.add_argument("--blocks", type=values.whole("--blocks", 1, 100_000), default=60, metavar="N",
                         help="blocks of 8x8 pixels, default 60")
    compare.add_argument("--rays", type=values.whole("--rays", 1, 100_000), default=128, metavar="N",
                         help="rays for each pixel, default 128")
    parser.set_defaults(frames=16)
    args = parser.parse(sys.argv[1:])
    settings = settings_of(args)
    context = create_headless_context()
    for name in args.scenes:
        scene = load_scene(name)
        camera = camera_of(args, scene)
        renderer = Renderer(context, args.size, settings)
        renderer.set_scene(scene)
        render_frames(renderer, camera, args.frames)
        start = time.perf_counter()
        rows, columns = random_blocks(renderer.read("view_depth") > 0, args.blocks)
        both = references(renderer, camera, scene, settings.start_level, rows, columns, args.rays)
        ours = renderer.read("indirect")[rows, columns].mean((1, 2))
        for reference, sums in zip(("R1", "R2"), both):
            bias, error = bias_and_error(ours, sums.mean((1, 2)))
            print(f"{name}: {reference} bias {bias:+.1%}, relative RMSE {error:.3f}")
        print(f"{name}: R2 / R1 = {both[1].sum() / both[0].sum():.3f}, {len(rows)} blocks, "
              f"{time.perf_counter() - start:.0f} s", flush=True)
        renderer.release()
    context.release()


if __name__ == "__main__":
    try:
        main()
    except UserError as error:
        sys.exit(f"error: {error}")
