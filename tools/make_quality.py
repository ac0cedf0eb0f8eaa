"""Measures scenes against the references and writes docs/quality.md from what comes out.

    .venv/bin/python tools/make_quality.py                              # the built-in scenes, ten to forty minutes each
    .venv/bin/python tools/make_quality.py cornell sponza=sponza.glb    # these anew, the others as they are
    .venv/bin/python tools/make_quality.py --page                       # the page alone, from docs/quality.json

Needs `pip install 'ssil-viewer[reference]'`.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Callable

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from ssil_viewer.commands.compare import IRRADIANCE_COLUMNS, error_of_irradiance  # noqa: E402
from ssil_viewer.gpu.context import create_headless_context  # noqa: E402
from ssil_viewer.peers.compare_all import compare_all  # noqa: E402
from ssil_viewer.pipeline import Renderer  # noqa: E402
from ssil_viewer.reference.bounce_series import bounce_series  # noqa: E402
from ssil_viewer.reference.compare import DIFFERENCES, Effort, Progress, compare  # noqa: E402
from ssil_viewer.reference.gpu_pictures import Scale  # noqa: E402
from ssil_viewer.reference.path_traced import path_trace, working_variant  # noqa: E402
from ssil_viewer.reference.whole_image import legend  # noqa: E402
from ssil_viewer.reproduce.studio import tile  # noqa: E402
from ssil_viewer.scene import default_camera, load_scene  # noqa: E402
from ssil_viewer.scene.model import Camera, Scene  # noqa: E402
from ssil_viewer.settings import Settings, load_preset  # noqa: E402

BUILTIN = "cornell", "arch", "atrium"
PRESET = "quality"          # with 256 samples and --visibility horizon
SIZE, FRAMES = (1280, 720), 16     # what `render` and `compare` take
SERIES = "cornell"
SERIES_SIZE = 640, 360
# As many rays as fit the time, for little noise in R3_visible: of 144 too few bring anything in Sponza, and left 8 %
EFFORT = Effort(path_rays=2592, seconds=200.0)
# Voxels take ten seconds a frame on two cores
VISIBILITIES = "off", "horizon"
DATA, PAGE, PICTURES = (ROOT / "docs" / name for name in ("quality.json", "quality.md", "images"))
GOAL = 0.12
PANEL, SCALE = (640, 360), Scale(limit=0.5, block=8)


def _say(what: str) -> Progress:
    last = [""]

    def heard(name: str, share: float) -> None:
        if name != last[0]:
            last[0] = name
            print(f"{what}: {name}", file=sys.stderr, flush=True)
    return heard


def _remembering():
    """A path tracer that traces the same view once: R3 does not depend on how we gather."""
    known: dict[tuple, dict[str, dict[str, np.ndarray]]] = {}

    def trace(description, tasks, progress):
        key = tuple(task.name for task in tasks)
        if key not in known:
            known[key] = path_trace(description, tasks, progress)
        return known[key]
    return trace


def measure(name: str, source: str, data: dict) -> Callable[[], Image.Image] | None:
    """A scene under the preset, and the other methods beside it, into `data`; what makes its picture, with R3."""
    scene, trace = load_scene(source), _remembering()
    camera = default_camera(scene)
    data["variant"] = working_variant()
    settings = load_preset(PRESET)
    view = dict(size=SIZE, settings=settings, camera=camera, frames=FRAMES, progress=_say(name))
    done = compare(scene, effort=EFFORT, trace=trace, **view)
    images = dict(done.pictures)      # those of the methods get the same names
    compare_all(scene, done, timed_frames=3, simpler_at_equal_time=True, visibilities=VISIBILITIES, **view)
    done.result["scene"] = name
    data["comparisons"][name] = done.result
    if name == SERIES:
        data["series"], warnings = bounce_series(
            scene, size=SERIES_SIZE, settings=settings, camera=camera,
            frames=FRAMES, spp=64, seconds=60.0, progress=_say(f"{name} bounces"))
        for warning in warnings:
            print(warning, file=sys.stderr)
    return (lambda: _picture(scene, camera, settings, images)) if "R3" in images else None


def _picture(scene: Scene, camera: Camera, settings: Settings, images: dict[str, np.ndarray]) -> Image.Image:
    """Ours, the path tracer's, direct light with the best constant, and where ours errs.

    Args:
        images: `Comparison.pictures`.
    """
    context = create_headless_context()
    renderer = Renderer(context, SIZE, settings.replaced({"bounces": 0}))
    try:
        renderer.set_scene(scene)
        renderer.render(camera)
        shown = {name: Image.fromarray(renderer.displayed(images[name])) for name in ("ssil", "R3", "constant_ambient")}
        visible = renderer.read("view_depth") > 0
    finally:
        renderer.release()
        context.release()
    # As the window's: background, where all are alike, does not count
    side, counted = SCALE.block, visible.astype(np.float64)
    error = (images["ssil"].astype(np.float64) - images["R3"]).mean(-1) * counted
    sums, pixels = (x[:SIZE[1] // side * side].reshape(-1, side, SIZE[0] // side, side).sum((1, 3))
                    for x in (error, counted))
    blocks = sums / np.maximum(pixels, 1) / images["R3"][visible].mean()
    colors = np.array(SCALE.stops)
    at = np.clip(blocks / SCALE.limit, -1, 1) * 2 + 2
    painted = np.stack([np.interp(at, range(len(colors)), colors[:, channel]) for channel in range(3)], -1)
    painted = np.round(painted * 255).astype(np.uint8).repeat(side, 0).repeat(side, 1)
    sheet = tile([("ours", shown["ssil"]), ("R3, path traced", shown["R3"]),
                  ("direct light and the best constant", shown["constant_ambient"]),
                  ("ours minus R3", Image.fromarray(painted))], 2, PANEL)
    scale = Image.fromarray(legend(sheet.width, SCALE, "ours minus R3 over the mean of R3, means of 8x8 pixels"))
    made = Image.new("RGB", (sheet.width, sheet.height + scale.height))
    made.paste(sheet, (0, 0))
    made.paste(scale, (0, sheet.height))
    return made


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    return [_row(*head), "|" + "---|" * len(head), *(_row(*row) for row in rows), ""]


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:+.1f} %"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def write_page(data: dict) -> None:
    """docs/quality.md."""
    found = sorted(data["comparisons"].items(), key=lambda item: (item[0] not in BUILTIN, item[0]))
    lines = ["# Errors against the references", "",
             "<!-- Made by tools/make_quality.py from docs/quality.json. Edit that instead. -->", "",
             f"`--preset {PRESET}`, {SIZE[0]}x{SIZE[1]}, {FRAMES} frames, each scene's default view; means over "
             f"{found[0][1]['block']}x{found[0][1]['block']} pixels.",
             "What the references are and what their differences show: [compare.md](compare.md). `sponza` is Crytek",
             "Sponza, which is not part of the program.", ""]
    now = asdict(load_preset(PRESET))
    older = [f"{name} ({result['frames']} frames, {result['settings'].get('visibility_rays', 0)} pairs of rays, "
             f"{result['settings']['levels']} levels)" for name, result in found
             if result["frames"] != FRAMES or result["settings"] != now or "R3_shown" not in result["irradiance"]]
    if older:
        lines += ["Measured before preset and references were what they are, not anew since, so that R3_visible there",
                  "is compared with ours without unseen light, and R2 to R3_shown is R2 to R3_visible: "
                  f"{'; '.join(older)}.", ""]
    for part in (_goals, _irradiance, _differences, _images, _methods):
        lines += part(found)
    if data.get("series"):
        lines += _series(data["series"])
    notes = sorted({(scene, warning.removeprefix("approximated in R3: "))
                    for scene, result in found for warning in result["warnings"]
                    if warning.startswith("approximated in R3: ")})
    lines += ["## What R3 approximates", "", *(f"- {scene}: {note}" for scene, note in notes), ""]
    seconds = ", ".join(f"{scene} {result['seconds']['R3']:.0f} s for {result['path_rays']} rays a pixel"
                        for scene, result in found)
    lines += [f"Mitsuba's variant was {data['variant']}, on two shared cores; R3 took {seconds}."]
    PAGE.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


def _goals(found: list[tuple[str, dict]]) -> list[str]:
    """What the project set out to reach, beside what it does."""
    def row(scene: str, result: dict) -> tuple[str, ...]:
        image = {name: found["relative_rmse"] for name, found in result["image"].items()}
        rows = {row["method"]: row["image"]["relative_rmse"] for row in result["methods"]["equal_time"]["rows"]}
        ours, peers = rows.pop("ssil_horizon"), {name: error for name, error in rows.items() if "ssil" not in name}
        best = min(peers, key=peers.get)
        return (scene, *(_number(result["irradiance"].get(kind, {}).get("relative_rmse"))
                         for kind in ("R3_shown", "R3_visible")),
                f"{image['ssil'] / image['direct_only']:.2f}", f"{image['ssil'] / image['constant_ambient']:.2f}",
                f"{ours:.3f}, {best} {peers[best]:.3f}", _number(result["differences"]["missing_layers"]))
    above = [f"{scene} to {kind} ({result['irradiance'][kind]['relative_rmse']:.3f})" for scene, result in found
             for kind in ("R3_shown", "R3_visible") if result["irradiance"][kind]["relative_rmse"] >= GOAL]
    return ["## Goals", "",
            "Relative RMSE of the irradiance from what the image shows to R3_shown, and with what the camera sees",
            f"between pixels (`--unseen-from view`) to R3_visible, to be below {GOAL}; error of the",
            "image, [unseen light](method/unseen.md) included, over that of direct light alone (at most 0.33) and over",
            "that with the best constant ambient light (0.5); the image's error at equal time beside the best simpler",
            "method's. The last column is what lies off screen or behind what the camera sees.", "",
            *_table(("scene", "R3_shown", "R3_visible", "over direct light", "over constant", "at equal time",
                     "R3_visible to R3_diffuse"), [row(scene, result) for scene, result in found]),
            f"With seed {found[0][1]['settings']['seed']}; how far seeds move the first two columns is in "
            f"[horizon.md](method/horizon.md#rays). Above their goal: {', '.join(above) or 'none'}.", ""]


def _irradiance(found: list[tuple[str, dict]]) -> list[str]:
    kinds = ("R1", "R2", "R3_shown", "R3_visible", "R3")
    noise = "; ".join(f"{scene} {result['blocks']}, " + " and ".join(
        _number(result["reference_noise"].get(kind)) for kind in ("R3", "R3_visible")) for scene, result in found)
    return ["## Irradiance of one bounce", "",
            "Bias, relative RMSE and correlation of ours against each reference: without unseen light to R1, R2 and",
            "R3_shown, with what of it the camera sees between pixels to R3_visible, and all of it to R3.", "",
            *_table(("scene", *kinds), [
                (scene, *(
                    f"{_percent(x['bias'])}, {_number(x['relative_rmse'])}, {_number(x['correlation'])}" if x else "-"
                    for x in (result["irradiance"].get(kind) for kind in kinds))) for scene, result in found]),
            f"Blocks compared, and the relative noise that is left in the means of R3 and R3_visible: {noise}.", ""]


def _differences(found: list[tuple[str, dict]]) -> list[str]:
    heads = {"noise": "ours, seed to seed", **{key: f"{a} to {b}" for key, (a, b) in DIFFERENCES.items()}}
    return ["## What the error consists of", "",
            "Rms differences of pairs, all over the mean of R3. They do not add up: they have signs.", "",
            *_table(("scene", *heads.values()), [
                (scene, *(_number(result["differences"].get(key)) for key in heads)) for scene, result in found])]


_CAPTIONS = {"sponza": "Crytek Sponza, (c) 2010 Frank Meinl, Crytek, CC BY 3.0, as the Computer Graphics Archive "
                       "(casual-effects.com) has it; textures at 512 pixels, without its banner"}


def _images(found: list[tuple[str, dict]]) -> list[str]:
    kinds = ("ssil", "direct_only", "constant_ambient")
    return ["## The image with one bounce, against R3", "",
            "Relative RMSE, then FLIP. Noise is what R3's image has: the relative RMSE of the whole of it, and FLIP",
            "between two halves of its samples, which is about twice what noise adds to the other figures.", "",
            *_table(("scene", "SSIL", "direct light", "with best constant", "noise of R3"), [
                (scene, *(f"{_number(x['relative_rmse'])}, {_number(x.get('flip'))}" for x in (
                    *(result["image"][kind] for kind in kinds), result["image_noise"])))
                for scene, result in found]),
            *(line for scene, _ in found if (PICTURES / f"quality-{scene}.jpg").exists() for line in (
                f"![{scene}: ours, R3, direct light and the best constant, the error of ours]"
                f"(images/quality-{scene}.jpg)", f"*{_CAPTIONS.get(scene, f'`builtin:{scene}`')}*", ""))]


def _methods(found: list[tuple[str, dict]]) -> list[str]:
    """Of the scenes that were measured with them."""
    measured = [(scene, result["methods"]) for scene, result in found if "methods" in result]
    if not measured:
        return []
    first = measured[0][1]
    lines = ["## Other methods", "",
             "Simpler methods at their best beside ours ([what they are](compare.md#other-methods)), as they are and",
             "with the samples that take about the time of SSIL with `--visibility horizon`. Relative RMSE of",
             "the image against R3, its FLIP, and relative RMSE of the irradiance against each reference; ms by",
             f"{first['clock']}. A single level has neither rays nor unseen light, and at most 1024 samples and",
             "512 texels, so that its time stays below ours where they should be equal.", ""]
    head = "scene", "method", "samples", "ms", "image", "FLIP", *IRRADIANCE_COLUMNS
    for title, of in (("As they are:", lambda methods: methods["rows"]),
                      ("At equal time:", lambda methods: methods["equal_time"]["rows"])):
        lines += [title, "", *_table(head, [_method_row(scene, row) for scene, methods in measured
                                            for row in of(methods)])]
    return lines


def _method_row(scene: str, row: dict) -> tuple[str, ...]:
    return (scene, row["title"], str(row.get("samples", "-")), f"{row['ms']:.3g}",
            *(_number(row["image"].get(key)) for key in ("relative_rmse", "flip")),
            *(_number(error_of_irradiance(row, kind)) for kind in IRRADIANCE_COLUMNS))


def _series(series: list[dict]) -> list[str]:
    return ["## More bounces", "",
            f"{SERIES}, {SERIES_SIZE[0]}x{SERIES_SIZE[1]}, `--visibility horizon`: the image after some "
            "bounces", "against all light of the path tracer, and the path tracer's own image after as many.", "",
            *_table(("bounces", "bias", "relative RMSE", "path tracer after as many", "ours to that"), [
                (str(x["bounces"]), _percent(x["bias"]), *(_number(x[key]) for key in (
                    "relative_rmse", "path_traced_relative_rmse", "same_bounces_relative_rmse"))) for x in series])]


def main() -> None:
    """Reads the flags, measures, and writes the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=BUILTIN, metavar="NAME[=FILE]")
    parser.add_argument("--page", action="store_true", help="write the page alone")
    args = parser.parse_args()
    data = json.loads(DATA.read_text()) if DATA.exists() else {"comparisons": {}}
    for given in () if args.page else args.scenes:
        name, _, file = given.partition("=")
        picture = measure(name, file or f"builtin:{name}", data)
        DATA.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        if picture is not None:
            picture().save(PICTURES / f"quality-{name}.jpg", quality=85)
    write_page(data)


if __name__ == "__main__":
    main()
