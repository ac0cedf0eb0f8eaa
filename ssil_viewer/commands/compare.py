"""`ssil-viewer compare`: the error of a view against references."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Callable

from ssil_viewer import output
from ssil_viewer.commands import measuring, shared, values
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError, pip_install

if TYPE_CHECKING:
    from ssil_viewer.reference.compare import Comparison

FRAMES = 16
_LINE_INTERVAL = 5.0    # s between two lines of how far something is, where there is no terminal
USAGE = "[SCENE] [flags]"
EPILOG = f"""\
references:
  R1  the sum over all pixels, nothing in between: shows noise, rings and mipmaps
  R2  R1 with true visibility by rays (embreex): shows the error of --visibility
  R3  a path tracer (Mitsuba 3): shows what the screen cannot know

R2 and R3 need packages: {pip_install("reference")}
docs/compare.md explains the numbers."""


def _references(text: str) -> tuple[str, ...]:
    from ssil_viewer.reference.compare import REFERENCES

    names = tuple(dict.fromkeys(name.strip().upper() for name in text.split(",") if name.strip()))
    unknown = [name for name in names if name not in REFERENCES]
    if unknown or not names:
        raise UserError(f"no reference is called {unknown[0]!r}" if unknown else "no reference is named", "--reference",
                        "give some of " + ",".join(REFERENCES))
    return names


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, "builtin:atrium")
    parser.add_argument("--json", metavar="FILE", help="write the result as JSON to a file, or - for standard output")
    group = parser.add_argument_group("references")
    group.add_argument("--reference", metavar="R1,R2,R3", default="R1,R2,R3", help="which to make, default all")
    group.add_argument("--blocks", type=values.whole("--blocks", 1, 100_000), default=100, metavar="N",
                       help="squares of 8x8 pixels where irradiance is compared, default 100")
    group.add_argument("--rays", type=values.whole("--rays", 1, 100_000), default=128, metavar="N",
                       help="rays of R2 for each pixel, default 128")
    group.add_argument("--spp", type=values.whole("--spp", 1, 1_000_000), default=64, metavar="N",
                       help="samples per pixel of R3's image, default 64; its irradiance takes 9/4 as many rays")
    group.add_argument("--time", type=values.whole("--time", 1, 1_000_000), default=120, metavar="SECONDS",
                       help="R3 takes no more samples after so long, for irradiance and image each; default 120")
    group.add_argument("--bounce-series", action="store_true",
                       help="also compare the image after 0 to 4 bounces with all light of the path tracer")
    group.add_argument("--all", action="store_true",
                       help="also compare error and time of every --visibility and of simpler methods: constant "
                       "ambient light, ambient occlusion, a gather of a single level")
    group.add_argument("--on-gpu", action="store_true",
                       help="make R1 and R2 by OpenGL, of all pixels, R2 without embreex; slow on software OpenGL")
    group.add_argument("--heat-map", metavar="FILE", help="write the error of irradiance against R2, or R1 without "
                       "it, as a picture with its scale, .png; implies --on-gpu")
    group.add_argument("--heat-map-range", type=values.real("--heat-map-range", 0.001, 100), default=0.5, metavar="X",
                       help="error at the end of the colours, over the reference's mean; default 0.5")
    group.add_argument("--heat-map-colors", choices=("signed", "absolute"), default="signed",
                       help="signed: blue is too dark and red too bright; default signed")
    group.add_argument("--pictures", metavar="FILE", help="write the compared images, linear, to an .npz file")
    add_image_flags(parser, f"frames rendered before the result is taken, default {FRAMES}")


def run(args: argparse.Namespace) -> None:
    """Compares, prints tables, and writes files."""
    target = output.check_target(args.json, (".json",)) if args.json not in (None, "-") else None
    pictures = output.check_target(args.pictures, (".npz",)) if args.pictures else None
    heat_map = output.check_target(args.heat_map, (".png",)) if args.heat_map else None
    for path in filter(None, (target, pictures, heat_map)):
        output.check_writable(path)
    references = _references(args.reference)
    if heat_map is not None and not {"R1", "R2"} & set(references):
        raise UserError("a heat map shows the error against R1 or R2", "--heat-map", "name one of them in --reference")
    settings = shared.settings_of(args)
    if args.all:
        from ssil_viewer.measure.bench import VISIBILITIES
        from ssil_viewer.peers.compare_all import check_settings, compare_all

        check_settings(settings)

    from ssil_viewer.reference.compare import Effort, compare, require_some
    from ssil_viewer.reference.gpu_pictures import Scale

    scale = Scale(args.heat_map_range, args.heat_map_colors == "signed") if heat_map is not None else None
    effort = Effort(references, args.blocks, args.rays, 9 * args.spp // 4, args.spp, float(args.time),
                    args.on_gpu or scale is not None, scale)
    require_some(effort)
    rows = [settings, *(settings.replaced({"visibility": kind}) for kind in VISIBILITIES)] if args.all else [settings]
    scene = shared.load(args, rows)
    camera = shared.camera_of(args, scene)
    with _progress() as heard:
        done = compare(scene, size=args.size, settings=settings, camera=camera, frames=args.frames or FRAMES,
                       effort=effort, progress=heard)
        if args.all:
            compare_all(scene, done, size=args.size, settings=settings, camera=camera, frames=args.frames or FRAMES,
                        progress=heard)
        if args.bounce_series:
            from ssil_viewer.reference.bounce_series import bounce_series

            series, warnings = bounce_series(scene, size=args.size, settings=settings, camera=camera,
                                             frames=args.frames or FRAMES, spp=args.spp, seconds=float(args.time),
                                             progress=heard)
            done.result["bounces"] = series
            done.warnings += warnings
    shared.warn(done.warnings)
    try:
        if target is not None:
            output.write_text(target, json.dumps(done.result, indent=2, allow_nan=False) + "\n")
            measuring.say_written(target)
        if heat_map is not None and done.heat_map is not None:
            output.write_png(heat_map, done.heat_map)
            measuring.say_written(heat_map)
        if pictures is not None:
            output.write_npz(pictures, done.pictures)
            measuring.say_written(pictures)
    finally:    # whatever becomes of the files
        if args.json == "-":
            print(json.dumps(done.result, indent=2, allow_nan=False))
        else:
            print_tables(done)


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """Shows what is being done on a terminal; elsewhere a line on standard error for each thing, and more while it
    takes long."""
    if sys.stderr is None:
        yield lambda what, share: None
        return
    if not sys.stderr.isatty():
        said: dict[str, float] = {}     # when it was spoken of last

        def say(what: str, share: float) -> None:
            now = time.monotonic()
            if what not in said:
                print(f"{what} ...", file=sys.stderr, flush=True)
            elif share < 1.0 and now - said[what] > _LINE_INTERVAL:
                print(f"{what} ... {100 * share:.0f} %", file=sys.stderr, flush=True)
            else:
                return
            said[what] = now
        yield say
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bars:
        tasks: dict[str, Any] = {}

        def show(what: str, share: float) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=1.0)
            bars.update(tasks[what], completed=share)
        yield show


def print_tables(done: Comparison) -> None:
    """Prints the result on standard output."""
    from rich.console import Console
    from rich.table import Table

    console, result = Console(soft_wrap=True), done.result
    console.print(f"{result['scene']}, {result['size'][0]}x{result['size'][1]}, {result['blocks']} blocks of "
                  f"{result['block']}x{result['block']} pixels", highlight=False)

    def table(title: str, head: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
        if not rows:
            return
        made = Table(title=title, title_justify="left")
        made.add_column("")
        for column in head:
            made.add_column(column, justify="right")
        for row in rows:
            made.add_row(*row)
        console.print(made)

    table("irradiance of one bounce", ("bias", "relative RMSE", "correlation"), [
        (name, _share(x["bias"]), _number(x["relative_rmse"]), _number(x["correlation"]))
        for name, x in result["irradiance"].items()])
    table("irradiance of the whole image", ("bias", "relative RMSE", "correlation"), [
        (name, _share(x["bias"]), _number(x["relative_rmse"]), _number(x["correlation"]))
        for name, x in result.get("whole_image", {}).items()])
    over = next((name for name in ("R3", "R2", "R1", "R3_visible") if name in result["irradiance"]), "")
    table(f"what the error consists of: rms differences over the mean of {over}", ("difference",), [
        (_MEANINGS[name], _number(value)) for name, value in result["differences"].items()])
    table("image against R3", ("relative RMSE", "FLIP"), [
        (name.replace("_", " "), _number(x["relative_rmse"]), _number(x.get("flip")))
        for name, x in (result["image"] | ({"noise_of_R3": result["image_noise"]} if result["image"] else {})).items()])
    table("bounces against all light", ("bias", "relative RMSE", "path tracer as far"), [
        (str(x["bounces"]), _share(x["bias"]), _number(x["relative_rmse"]), _number(x["path_traced_relative_rmse"]))
        for x in result.get("bounces", [])])
    if methods := result.get("methods"):
        equal = methods["equal_time"]
        to = next(row["title"] for row in methods["rows"] if row["method"] == equal["to"])
        table(f"methods; ms by {methods['clock']}, medians of {methods['timed_frames']} frames",
              *_method_table(methods["rows"]))
        table(f"methods at equal time: with the samples that take about the {equal['ms']:.3g} ms of {to}",
              *_method_table(equal["rows"]))
        for line in _method_notes(methods):
            console.print(line, highlight=False)
    together: dict[float, list[str]] = {}       # R1 and R2 are made in one go
    for name, seconds in result["seconds"].items():
        together.setdefault(seconds, []).append(name)
    for seconds, names in together.items():
        console.print(f"{' and '.join(names)}: {seconds:.0f} s", highlight=False)


_MEANINGS = {
    "noise": "noise: from seed to seed",
    "method_without_visibility": "ours to R1: noise, rings, mipmaps, visibility mode",
    "method_with_visibility": "ours to R2: noise, rings, mipmaps, error of the visibility mode",
    "coarse_senders": "R1 with texels of the starting level as senders to R1: mipmaps",
    "visibility": "R1 to R2: visibility as a whole",
    "screen_senders": "R2 to R3_shown: senders as pixels, direct light",
    "between_pixels": "R3_shown to R3_visible: seen by the camera, but by no pixel",
    "missing_layers": "R3_visible to diffuse R3: off screen and hidden layers",
    "mirrored_visible": "R3_visible without and with what senders mirror",
    "mirrored": "diffuse R3 to R3: what senders mirror",
    "all": "ours to R3: all of it",
}


IRRADIANCE_COLUMNS = "R1", "R2", "R3_shown", "R3"


def error_of_irradiance(row: dict[str, Any], reference: str) -> float | None:
    """Relative RMSE of a method's irradiance. None also for ambient light that was fitted to R3's image, of the
    references that hold only what the image shows: it would be compared with other light than it stands for."""
    if "ambient" in row and row["image"] and reference != "R3":
        return None
    return row["irradiance"].get(reference, {}).get("relative_rmse")


_METHOD_COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "samples": lambda row: str(row.get("samples", "-")),
    "ms": lambda row: f"{row['ms']:.3g}",
    "image": lambda row: _number((row["image"] or {}).get("relative_rmse")),
    "FLIP": lambda row: _number((row["image"] or {}).get("flip")),
    **{name: lambda row, name=name: _number(error_of_irradiance(row, name)) for name in IRRADIANCE_COLUMNS},
}


def _method_table(rows: list[dict[str, Any]]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows, without columns that nothing stands in: those of references that were not made."""
    columns = {name: [cell(row) for row in rows] for name, cell in _METHOD_COLUMNS.items()}
    columns = {name: cells for name, cells in columns.items() if set(cells) - {"-"}}
    return tuple(columns), list(zip((row["title"] for row in rows), *columns.values()))


def _method_notes(methods: dict[str, Any]) -> list[str]:
    """What the numbers are, and which methods have nothing left to be made faster by."""
    head, _ = _method_table(methods["rows"])
    references = [name for name in head if name.startswith("R")]
    meanings = [f"{', '.join(references)}: relative RMSE of irradiance against the reference"] if references else []
    meanings += ["image: the same of the picture against R3"] if "image" in head else []
    found = ["; ".join(meanings) + ". Lower is better."]
    for row in methods["equal_time"]["rows"]:
        for work in ("samples", "slices"):
            if row.get(work) == 1:
                found.append(f"{row['title']} takes {row['ms']:.3g} ms with a single {work.removesuffix('s')} already.")
    return found


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:+.1%}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
