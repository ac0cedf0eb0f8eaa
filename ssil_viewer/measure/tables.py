"""A benchmark's report as tables: for terminal and window as text cells, and as CSV and Markdown."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from typing import Any, Iterable, Sequence

from ssil_viewer.measure.bench import ROW_NAMES, TALK_ROWS
from ssil_viewer.settings import Settings

_FLOOR = "The floor of a pass is the time to read its inputs and write its outputs once, as fast as a copy."
_PER_TABLE = len(TALK_ROWS)     # rows of the benchmark side by side in a table of passes


@dataclass(frozen=True)
class Table:
    """A table of text cells.

    Attributes:
        title: What it shows.
        headers, rows: Cells of the first line and of the others. The first column holds names, the others numbers.
        note: Stands below it.
    """

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def heading(report: dict[str, Any]) -> str:
    """Where and how it was measured; stands above every table of a file, since they may be taken out one by one."""
    return f"{_place(report)}, {report['clock']}"


def heading_lines(report: dict[str, Any]) -> list[str]:
    """The same for a terminal, once ahead of all tables."""
    return [_place(report), f"Times are by {report['clock']}."]


def _place(report: dict[str, Any]) -> str:
    width, height = report["size"]
    return f"{report['scene']}, {width}x{height}, {report['renderer']}, OpenGL {report['version']}"


def sums_table(report: dict[str, Any]) -> Table:
    """One line for each row of the benchmark: the talk's columns, and the whole frame."""
    names = _shown_settings(report)
    headers = (row_header(report), "voxelization", "indirect", "upsampling & compositing", "total", "copies", "frame",
               "p10 .. p90", "MB")
    rows = []
    for row in report["rows"]:
        sums = [milliseconds(row[name])
                for name in ("voxelization_ms", "indirect_ms", "upsampling_compositing_ms", "total_ms")]
        spread = f"{_short(row['frame_p10_ms'])} .. {_short(row['frame_p90_ms'])}"
        megabytes = row["target_bytes"] / 1e6
        rows.append((_row_title(row, names), *sums, _short(row["total_copies"]), milliseconds(row["frame_wall_ms"]),
                     spread, f"{megabytes:.1f}" if megabytes < 9.95 else f"{megabytes:.0f}"))
    frames = f"{report['frames']} frame{'s' if report['frames'] > 1 else ''}"
    return Table(f"ms, median of {frames}", headers, tuple(rows))


def row_header(report: dict[str, Any]) -> str:
    """What stands in the first cell of each row."""
    return ", ".join(name.replace("_level", "").replace("_", " ") for name in _shown_settings(report))


def pass_tables(report: dict[str, Any]) -> list[Table]:
    """The passes of some rows side by side: median, and how many times its floor."""
    rows, names = report["rows"], _shown_settings(report)
    tables = []
    for first in range(0, len(rows), _PER_TABLE):
        part = rows[first:first + _PER_TABLE]
        passes = list(dict.fromkeys(name for row in part for name in row["passes"]))
        lines = [(name, *(_pass_cell(row["passes"].get(name)) for row in part)) for name in passes]
        last = first + _PER_TABLE >= len(rows)
        tables.append(Table("ms, median (times the floor)", ("pass", *(_row_title(row, names) for row in part)),
                            tuple(lines), _FLOOR if last else ""))
    return tables


def notes(report: dict[str, Any]) -> list[str]:
    """What a reader should know beside the numbers."""
    copy = report["copy"]
    found = [f"copies: the total in copies of an image of this size, {milliseconds(copy['median_ms'])} ms each here "
             f"({copy['bytes_per_second'] / 1e9:.3g} GB/s)."]
    apart = sum(row["adds_up"] is False for row in report["rows"])
    if apart:
        found.append(f"In {apart} row{'s' if apart > 1 else ''} the passes do not add up to the frame within 10 %: "
                     "something else took its time, or the timer does not tell the truth.")
    unknown = sum(row["adds_up"] is None for row in report["rows"])
    if unknown:
        found.append(f"In {unknown} row{'s' if unknown > 1 else ''} handing over its commands takes a frame's whole "
                     "time, so whether the passes add up to it cannot be told; a larger --size would tell.")
    return found


def to_json(report: dict[str, Any]) -> str:
    """The report as JSON text."""
    return json.dumps(report, indent=1, allow_nan=False) + "\n"


def to_markdown(report: dict[str, Any], tables: Iterable[Table] | None = None,
                remarks: Iterable[str] | None = None) -> str:
    """The tables as Markdown, with the remarks above them; without either, those of a benchmark."""
    tables = [sums_table(report), *pass_tables(report)] if tables is None else tables
    parts = [f"# {heading(report)}\n", *(f"{note}\n" for note in (notes(report) if remarks is None else remarks))]
    return "\n".join([*parts, *(_markdown_table(table, report) for table in tables)])


def to_csv(report: dict[str, Any]) -> str:
    """One line for each row, which stands alone: every line names renderer, clock and settings."""
    names = _shown_settings(report)
    where = {"program": report["program"], "renderer": report["renderer"], "version": report["version"],
             "timer": report["timer"], "scene": report["scene"], "width": report["size"][0],
             "height": report["size"][1], "frames": report["frames"]}
    lines = []
    for row in report["rows"]:
        line = {**where, **{name: _value(row, name) for name in names},
                **{name: value for name, value in row.items() if name.endswith(("_ms", "_bytes", "_copies"))}}
        for name, values in row["passes"].items():
            line |= {f"{name}_{key}": value for key, value in values.items()}
        lines.append(line)
    return csv_text(lines)


def csv_text(lines: Sequence[dict[str, Any]]) -> str:
    """CSV of dictionaries, with the keys of all of them as columns."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(dict.fromkeys(key for line in lines for key in line)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def csv_rows(rows: Iterable[Sequence[str]]) -> str:
    """CSV of cells, the first row their headers."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _shown_settings(report: dict[str, Any]) -> list[str]:
    """The talk's settings, and those that differ between the rows."""
    names = dict.fromkeys(name for row in report["rows"] for name in row["settings"] if name not in ROW_NAMES)
    differing = [name for name in names if len({repr(row["settings"].get(name)) for row in report["rows"]}) > 1]
    return [*ROW_NAMES, *differing]


def _value(row: dict[str, Any], name: str) -> Any:
    return row[name] if name in row else row["settings"].get(name, getattr(Settings(), name))


def _setting(row: dict[str, Any], name: str) -> str:
    value = _value(row, name)
    if name == "start_level":
        return f"1/{2**value}"
    return {True: "on", False: "off"}[value] if isinstance(value, bool) else f"{value}"


def _row_title(row: dict[str, Any], names: Sequence[str]) -> str:
    return ", ".join(_setting(row, name) if name in ROW_NAMES else f"{name} {_setting(row, name)}" for name in names)


def _pass_cell(values: dict[str, float] | None) -> str:
    if values is None:
        return "-"
    floor = f" ({values['times_floor']:.1f})" if "times_floor" in values else ""
    return milliseconds(values["median_ms"]) + floor


def milliseconds(value: float) -> str:
    """Three digits that mean something, never an exponent."""
    return f"{value:.3f}" if abs(value) < 1 else f"{value:.2f}" if abs(value) < 100 else f"{value:.0f}"


def _short(value: float) -> str:
    """Three digits, or as many as stand before the point: nine columns are to fit into a terminal."""
    return f"{value:#.3g}" if abs(value) < 99.95 else f"{value:.0f}"


def _markdown_table(table: Table, report: dict[str, Any]) -> str:
    rule = ["---", *["---:"] * (len(table.headers) - 1)]
    lines = [" | ".join(cells) for cells in (table.headers, rule, *table.rows)]
    below = [table.note, ""] if table.note else []
    return "\n".join([f"{heading(report)}: {table.title}", "", *(f"| {line} |" for line in lines), "", *below])
