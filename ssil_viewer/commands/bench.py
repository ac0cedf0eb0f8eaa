"""`ssil-viewer bench`: what each pass costs, under many settings."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Iterator

from ssil_viewer import output
from ssil_viewer.commands import shared, values
from ssil_viewer.commands.parser import Parser, add_image_flags, add_scene
from ssil_viewer.errors import UserError
from ssil_viewer.settings import Settings, knobs

if TYPE_CHECKING:
    from ssil_viewer.measure.tables import Table
    from ssil_viewer.pipeline import Renderer

USAGE = "[SCENE] [flags]"
EPILOG = """\
Without --sweep the rows are the four of the talk's table, (1/4, 4, 64), (1/4, 4, 256), (1/2, 4, 64) and (1/2, 5, 64)
in start resolution, levels and samples, with visibility off, voxel and horizon. A flag, preset or settings file that
sets one of these four settings sets it in all rows; other settings hold for all rows.

  ssil-viewer bench builtin:atrium --json bench.json
  ssil-viewer bench --sweep samples=16,64,256 --sweep start-level=1,2 --visibility horizon

docs/benchmarks.md says how to read the tables."""
_FORMATS = {"json": (".json",), "csv": (".csv",), "markdown": (".md", ".markdown")}
_PIPE_WIDTH = 160
_ROW_SETTINGS = ("start_level", "levels", "samples", "visibility")


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    add_scene(parser, "builtin:atrium")
    add_file_flags(parser)
    parser.add_argument("--sweep", action="append", default=[], metavar="SETTING=A,B,...",
                        help="measure these values of a setting; several of them give every combination")
    add_image_flags(parser, "frames of each row that count; default 200 with a GPU, 10 on software OpenGL")


def add_file_flags(parser: Parser) -> None:
    """The files that a table can go to."""
    parser.add_argument("--json", metavar="FILE", help="write all numbers as JSON; - for standard output")
    parser.add_argument("--csv", metavar="FILE", help="write one line for each row, with every pass")
    parser.add_argument("--markdown", metavar="FILE", help="write the tables as Markdown")


def run(args: argparse.Namespace) -> None:
    """Measures, prints the tables and writes the files."""
    files = check_files(args)
    rows = rows_of(args)

    from ssil_viewer.measure import tables
    from ssil_viewer.measure.bench import Bench

    with renderer_of(args, rows[0]) as renderer:
        scene = shared.load(args)
        camera = shared.camera_of(args, scene)
        renderer.set_scene(scene)
        bench = Bench(renderer, camera, rows, args.frames)
        with progress_bar() as show:
            bench.run(lambda bench: show(bench.row_name, *bench.progress))
        shared.warn(renderer.warnings)
        report = bench.report()
    print_tables(tables.heading(report), [tables.sums_table(report), *tables.pass_tables(report)], tables.notes(report),
                 to_stderr=args.json == "-")
    write_files(files, {"json": lambda: tables.to_json(report), "csv": lambda: tables.to_csv(report),
                        "markdown": lambda: tables.to_markdown(report)})


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
        given = {info.name for info in knobs() if hasattr(args, info.name)}
        pinned = {name: getattr(base, name) for name in _ROW_SETTINGS
                  if name in given or getattr(base, name) != getattr(Settings(), name)}
        return talk_settings(base, pinned)
    rows = swept_settings(base, sweeps)
    for row in rows:
        shared.check_fits(args.size, row, dict.fromkeys({"start_level", "levels"} & sweeps.keys(), "--sweep"))
    return rows


@contextmanager
def renderer_of(args: argparse.Namespace, settings: Settings) -> Iterator[Renderer]:
    """A renderer on a context of its own."""
    from ssil_viewer.gpu.context import create_headless_context
    from ssil_viewer.pipeline import Renderer

    context = create_headless_context()
    try:
        renderer = Renderer(context, args.size, settings)
        try:
            yield renderer
        finally:
            renderer.release()
    finally:
        context.release()


@contextmanager
def progress_bar() -> Iterator[Callable[[str, int, int], None]]:
    """Yields a function that is told what is being done, how much of it is done, and of how much."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda what, done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), \
        TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1)
        yield lambda what, done, total: progress.update(task, description=what, completed=done, total=total)


def check_files(args: argparse.Namespace) -> dict[str, Path | None]:
    """Where each kind of file goes; None is standard output. Raises UserError before anything is measured."""
    files: dict[str, Path | None] = {}
    for kind, endings in _FORMATS.items():
        name = getattr(args, kind)
        if name is not None:
            files[kind] = None if kind == "json" and name == "-" else output.check_target(name, endings)
    found = [path for path in files.values() if path is not None]
    if len(set(found)) < len(found):
        raise UserError("two outputs are the same file", str(found[0]), "give each its own")
    for path in found:
        output.check_writable(path)
    return files


def write_files(files: dict[str, Path | None], texts: dict[str, Callable[[], str]]) -> None:
    """Write each file completely or not at all. Raises UserError when one cannot be written."""
    for kind, path in files.items():
        if path is None:
            print(texts[kind](), end="")
        else:
            output.write_text(path, texts[kind]())
            print(f"wrote {path}", file=sys.stderr)


def print_tables(title: str, tables: list[Table], notes: list[str], to_stderr: bool = False) -> None:
    """Tables in the terminal; each has the title, which names renderer and clock."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as RichTable

    console = Console(stderr=to_stderr)
    if not console.is_terminal:
        console = Console(stderr=to_stderr, width=_PIPE_WIDTH)     # a file has no edge to wrap at
    for table in tables:
        # On a line of its own: a title within the table would be broken to the table's width
        console.print(f"{title}: {table.title}", markup=False, highlight=False, soft_wrap=True)
        shown = RichTable(box=box.SIMPLE_HEAD)
        for at, name in enumerate(table.headers):
            shown.add_column(name, justify="right" if at else "left", overflow="fold")
        for row in table.rows:
            shown.add_row(*map(escape, row))
        console.print(shown)
    for note in notes:
        console.print(note, markup=False, highlight=False)

