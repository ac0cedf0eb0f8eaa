"""What the commands that measure share: a renderer of their own, progress, tables and files."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Iterator

from ssil_viewer import output
from ssil_viewer.commands import shared
from ssil_viewer.commands.parser import Parser
from ssil_viewer.errors import UserError
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.measure.tables import Table
    from ssil_viewer.pipeline import Renderer
    from ssil_viewer.scene.model import Camera

_FORMATS = {"json": (".json",), "csv": (".csv",), "markdown": (".md", ".markdown")}
_PIPE_WIDTH = 160
Files = dict[str, Path | None]
"""Kind of file -> where it goes; None is standard output."""


def add_file_flags(parser: Parser) -> None:
    """The files that a table can go to."""
    parser.add_argument("--json", metavar="FILE", help="write all numbers as JSON; - for standard output")
    parser.add_argument("--csv", metavar="FILE", help="write one line for each row, with every pass")
    parser.add_argument("--markdown", metavar="FILE", help="write the tables as Markdown")


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


def open_scene(args: argparse.Namespace, renderer: Renderer, rows: Sequence[Settings]) -> Camera:
    """Load the scene into the renderer; returns the view. `rows` as of `shared.load`."""
    scene = shared.load(args, rows)
    camera = shared.camera_of(args, scene)
    renderer.set_scene(scene)
    return camera


@contextmanager
def progress_bar(in_pipes: bool = False) -> Iterator[Callable[[str, int, int], None]]:
    """Yields a function that is told what is being done, how much of it is done, and of how much.

    Args:
        in_pipes: Without a terminal, each new thing that is done has a line of its own: for what takes minutes.
    """
    if sys.stderr is None or not (in_pipes or sys.stderr.isatty()):
        yield lambda what, done, total: None
        return
    if not sys.stderr.isatty():
        last = ""

        def say(what: str, done: int, total: int) -> None:
            nonlocal last
            if what and what != last:
                last = what
                print(f"{what} ...", file=sys.stderr, flush=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), \
        TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1)
        yield lambda what, done, total: progress.update(task, description=what, completed=done, total=total)


def check_files(args: argparse.Namespace) -> Files:
    """Where each kind of file goes; None is standard output. Raises UserError before anything is measured."""
    files: Files = {}
    for kind, endings in _FORMATS.items():
        name = getattr(args, kind, None)
        if name is not None:
            files[kind] = None if kind == "json" and name == "-" else output.check_target(name, endings)
    found = [path for path in files.values() if path is not None]
    if len(set(found)) < len(found):
        raise UserError("two outputs are the same file", str(found[0]), "give each its own")
    for path in found:
        output.check_writable(path)
    return files


def write_files(files: Files, texts: dict[str, Callable[[], str]]) -> None:
    """Write each file completely or not at all, and then what goes to standard output, as that may fail.

    Raises:
        UserError: A file cannot be written.
    """
    for kind, path in files.items():
        if path is not None:
            output.write_text(path, texts[kind]())
            say_written(path)
    for kind in (kind for kind, path in files.items() if path is None):
        print(texts[kind](), end="")


def say_written(path: Path) -> None:
    """On standard error, since a table may go through standard output."""
    print(f"wrote {path}", file=sys.stderr)


def print_tables(heading: list[str], tables: list[Table], notes: list[str], to_stderr: bool = False) -> None:
    """Tables in the terminal, below the heading, which names renderer and clock."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as RichTable

    console = Console(stderr=to_stderr)
    in_file = not console.is_terminal
    if in_file:
        console = Console(stderr=to_stderr, width=_PIPE_WIDTH)     # of tables; a file has no edge to wrap text at
    for line in heading:
        console.print(line, markup=False, highlight=False, soft_wrap=in_file)
    for table in tables:
        # On a line of its own: a title within the table would be broken to the table's width
        console.print()
        console.print(table.title, markup=False, highlight=False, soft_wrap=True)
        shown = RichTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
        columns = list(zip(table.headers, *table.rows))
        for at, (cells, width) in enumerate(zip(columns, _widths(columns, console.width))):
            shown.add_column(cells[0], justify="right" if at else "left", overflow="fold", width=width)
        for row in table.rows:
            shown.add_row(*map(escape, row))
        console.print(shown)
        if table.note:
            console.print(table.note, markup=False, highlight=False, soft_wrap=in_file)
    console.print()
    for note in notes:
        console.print(note, markup=False, highlight=False, soft_wrap=in_file)


def _widths(columns: list[tuple[str, ...]], room: int) -> list[int]:
    """Width of each column, header first: whole where there is room, else broken headers, else cells of as few lines as
    fit.

    Lines are broken between words only, so that a number stays one.
    """
    whole = [max(map(len, cells)) for cells in columns]
    room -= 2 * (len(columns) - 1)      # between them
    if sum(whole) <= room:
        return whole
    most = max([1, *(len(cell.split()) for _, *cells in columns for cell in cells)])
    for lines in range(1, most + 1):
        widths = [max([*map(len, header.split()), *(_narrowest(cell, lines) for cell in cells)])
                  for header, *cells in columns]
        if sum(widths) <= room:
            break
    return widths


def _narrowest(text: str, lines: int) -> int:
    """The least width at which a text takes at most some number of lines, no word broken."""
    longest = max(map(len, text.split()), default=0)
    return next(width for width in range(max(longest, 1), max(len(text), 1) + 1)
                if len(textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False)) <= lines)
