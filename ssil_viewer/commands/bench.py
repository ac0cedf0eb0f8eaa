"""`ssil-viewer bench`: what each pass costs, under many settings."""

from __future__ import annotations

import argparse

from ssil_viewer import output
from ssil_viewer.commands import measuring, shared, values
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.settings import Settings

USAGE = "[SCENE] [flags]"
EPILOG = """\
Without --sweep the rows are the four of the talk's table, (1/4, 4, 64), (1/4, 4, 256), (1/2, 4, 64) and (1/2, 5, 64)
in start resolution, levels and samples, with visibility off, voxel and horizon. A flag, preset or settings file that
sets one of these four settings sets it in all rows; other settings hold for all rows.

  ssil-viewer bench builtin:atrium --json bench.json
  ssil-viewer bench --sweep samples=16,64,256 --sweep start-level=1,2 --visibility horizon
  ssil-viewer bench --scaling --quick --plots scaling.svg

docs/benchmarks.md says how to read the tables."""
_SCENE, _SCALING_SCENE = "builtin:atrium", "builtin:cornell"    # the second has few triangles to begin with
_ROW_SETTINGS = ("start_level", "levels", "samples", "visibility")
_PLOTS = (".svg", ".png", ".pdf")


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, f"{_SCENE}, with --scaling {_SCALING_SCENE}")
    parser.set_defaults(scene=None)
    measuring.add_file_flags(parser)
    parser.add_argument("--sweep", action="append", default=[], metavar="SETTING=A,B,...",
                        help="measure these values of a setting; several of them give every combination")
    parser.add_argument("--scaling", action="store_true", help="measure how the indirect passes scale with triangles, "
                        "lights, image size, samples and levels instead, and judge it")
    parser.add_argument("--quick", action="store_true", help="with --scaling: fewer points")
    parser.add_argument("--plots", metavar="FILE", help="with --scaling: plots as .svg, .png or .pdf; needs matplotlib")
    add_image_flags(parser, "frames of each row that count; default 200 with a GPU, 10 on software OpenGL; with "
                    "--scaling 60 and 5, in each round")


def run(args: argparse.Namespace) -> None:
    """Measures, prints the tables and writes the files."""
    args.scene = args.scene or (_SCALING_SCENE if args.scaling else _SCENE)
    files = measuring.check_files(args)
    if args.scaling:
        _run_scaling(args, files)
        return
    if args.quick or args.plots is not None:
        raise UserError("only scaling has points and plots", "--quick" if args.quick else "--plots", "add --scaling")
    rows = rows_of(args)

    from ssil_viewer.measure import tables
    from ssil_viewer.measure.bench import Bench

    with measuring.renderer_of(args, rows[0]) as renderer:
        camera = measuring.open_scene(args, renderer, rows)
        bench = Bench(renderer, camera, rows, args.frames)
        try:
            with measuring.progress_bar() as show:
                bench.run(lambda bench: show(bench.row_name, *bench.progress))
        finally:
            bench.close()
        shared.warn(renderer.warnings)
        report = bench.report()
    try:
        measuring.write_files(files, {"json": lambda: tables.to_json(report), "csv": lambda: tables.to_csv(report),
                                      "markdown": lambda: tables.to_markdown(report)})
    finally:    # whatever becomes of the files
        measuring.print_tables(tables.heading_lines(report), [tables.sums_table(report), *tables.pass_tables(report)],
                               tables.notes(report), to_stderr=args.json == "-")


def rows_of(args: argparse.Namespace) -> list[Settings]:
    """The settings of each row.

    Raises:
        UserError: A sweep is wrong, or its levels do not fit the image.
    """
    from ssil_viewer.measure.bench import swept_settings, talk_settings
    from ssil_viewer.measure.sweep import parse_sweeps

    base = shared.settings_of(args)
    sweeps = parse_sweeps(args.sweep, values.knob_value)
    if not sweeps:
        given = shared.names_given(args)    # of a picture, which holds all settings, those that are not the defaults
        pinned = {name: getattr(base, name) for name in _ROW_SETTINGS
                  if name in given or getattr(base, name) != getattr(Settings(), name)}
        return talk_settings(base, pinned)
    rows = swept_settings(base, sweeps)
    for row in rows:
        shared.check_fits(args.size, row, dict.fromkeys({"start_level", "levels"} & sweeps.keys(), "--sweep"))
    return rows


def _run_scaling(args: argparse.Namespace, files: measuring.Files) -> None:
    if args.sweep:
        raise UserError("scaling has series of its own", "--sweep", "give either --sweep or --scaling")
    from ssil_viewer.measure import plots, scaling, tables

    picture = None
    if args.plots is not None:
        picture = output.check_target(args.plots, _PLOTS)
        output.check_writable(picture)
        plots.require()
    settings = shared.settings_of(args)
    with measuring.renderer_of(args, settings) as renderer:
        camera = measuring.open_scene(args, renderer, [settings])
        with measuring.progress_bar(in_pipes=True) as show:
            report = scaling.measure(renderer, camera, args.quick, args.frames, show)
    found = scaling.report_tables(report)
    try:
        measuring.write_files(files, {
            "json": lambda: tables.to_json(report), "csv": lambda: tables.csv_text(scaling.csv_lines(report)),
            "markdown": lambda: tables.to_markdown(report, found, scaling.verdicts(report))})
        if picture is not None:
            plots.write(picture, report)
            measuring.say_written(picture)
    finally:    # whatever becomes of the files
        measuring.print_tables(tables.heading_lines(report), found, scaling.verdicts(report),
                               to_stderr=args.json == "-")
