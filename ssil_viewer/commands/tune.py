"""`ssil-viewer tune`: the settings with the least error for a time budget, on this view and this machine."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from ssil_viewer import output
from ssil_viewer.commands import measuring, shared, values
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.scene.warning_list import printable

if TYPE_CHECKING:
    from ssil_viewer.measure.tune import Candidate

USAGE = "[SCENE] --ms X [-o FILE] [flags]"
EPILOG = """\
Tries start levels, levels and samples, measures the time of voxelization, indirect light, upsampling and compositing of
each, and compares one frame of each, without the temporal filter, with the same method at full starting resolution with
many samples. Visibility and all other settings are taken as given; --start-level, --levels or --samples fixes that one.

  ssil-viewer tune scene.glb --ms 4 -o mine.toml      # software OpenGL needs more, such as --ms 100
  ssil-viewer scene.glb --settings mine.toml"""

_NOTES = ["Errors are against this method at its best, in one frame without the temporal filter: not against real "
          "light, as those of compare are.",
          "Times are those of the talk's passes; the scene and its direct light come on top (see bench)."]


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, "builtin:atrium")
    parser.add_argument("--ms", required=True, type=_budget, metavar="X", help="milliseconds that the passes may take")
    parser.add_argument("-o", "--output", metavar="FILE", help="write the settings as a preset (.toml); else show them")
    parser.add_argument("--json", metavar="FILE", help="write all candidates as JSON; - for standard output")
    add_image_flags(parser, "frames of each time that count; default 40 with a GPU, 5 on software OpenGL")


def run(args: argparse.Namespace) -> None:
    """Measures, prints the table, and writes the preset."""
    files = measuring.check_files(args)
    target = output.check_target(args.output, (".toml",)) if args.output is not None else None
    if target is not None:
        output.check_writable(target)
    settings = shared.settings_of(args)
    if settings.bounces == 0:
        raise UserError("without a bounce there is no indirect light to tune", "--bounces", "give 1 or more")

    from ssil_viewer.measure import tables, tune

    pinned = {name: getattr(settings, name) for name in shared.flags_given(args).intersection(tune.TUNED)}
    with measuring.renderer_of(args, settings) as renderer:
        camera = measuring.open_scene(args, renderer, [settings])
        with measuring.progress_bar() as show:
            tried = tune.tune(renderer, camera, args.ms, pinned, args.frames, show)
        chosen = tune.best(tried, args.ms)
        report = tune.report(renderer, tried, chosen, args.ms)
    notes = ["* is the least error within the budget.", *_NOTES] if chosen else _NOTES
    text = _preset(report, chosen) if chosen is not None else ""
    try:
        if target is not None and text:
            output.write_text(target, text)
            measuring.say_written(target)
        measuring.write_files(files, {"json": lambda: tables.to_json(report)})
    finally:    # whatever becomes of the files
        measuring.print_tables(tables.heading_lines(report), [tune.front_table(tried, chosen, args.ms)], notes,
                               to_stderr=args.json == "-")
    if chosen is None:
        raise tune.nothing_within(tried, args.ms)
    if target is None and args.json != "-":
        print(text, end="")


def _preset(report: dict[str, Any], chosen: Candidate) -> str:
    from ssil_viewer.saved_view import settings_text

    width, height = report["size"]
    head = (f"Least error within {report['budget_ms']:g} ms: {chosen.ms:.3g} ms, {100 * chosen.error:.1f} % on "
            f"{report['scene']} at {width}x{height}, {report['renderer']}, {report['clock']}.")
    return f"# {printable(head, 400)}\n{settings_text(chosen.settings)}"


def _budget(text: str) -> float:
    value = values.number(text)
    if value is None or not 0.0 < value <= 1e6:
        raise UserError(f"cannot use {text!r} as a time", "--ms", "give milliseconds above 0, such as 4")
    return float(value)
