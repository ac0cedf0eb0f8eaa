"""The benchmark without OpenGL: groups of passes, sweeps, rows, tables and files."""

from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path

import pytest

from ssil_viewer.commands import bench as command
from ssil_viewer.commands import measuring, shared, values
from ssil_viewer.commands.parser import Parser
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.timers import PassTime
from ssil_viewer.measure import tables
from ssil_viewer.measure.bench import ROW_NAMES, swept_settings, talk_settings
from ssil_viewer.measure.groups import GROUPS, TALK, group_times, total_ms
from ssil_viewer.measure.sweep import parse_sweeps
from ssil_viewer.passes import FRAME
from ssil_viewer.settings import Settings, knobs


def parse(*words: str):
    parser = Parser("ssil-viewer bench", command.USAGE, "", command.EPILOG)
    command.add_flags(parser)
    parsed = parser.parse(list(words))
    shared.take_picture(parsed)     # which settles the size
    return parsed


def test_every_pass_of_the_frame_belongs_to_one_group():
    grouped = [name for names in GROUPS.values() for name in names]
    assert len(grouped) == len(set(grouped))
    assert {p.name for p in FRAME} <= set(grouped)


def test_sums_of_groups():
    passes = {"gather": PassTime(2.0, 1.0, 3.0, 5), "mipmap": PassTime(1.5, 1.0, 2.0, 5),
              "composite": PassTime(0.25, 0.2, 0.3, 5), "gbuffer": PassTime(9.0, 9.0, 9.0, 5)}
    groups = group_times(passes)
    assert groups == {"scene": 9.0, "direct": 0, "voxelization": 0, "indirect": 3.5, "upsampling_compositing": 0.25,
                      "display": 0}
    assert total_ms(groups) == 3.75
    assert group_times(passes, "p10_ms")["indirect"] == 2.0


def test_further_bounces_count_into_the_groups_of_their_passes():
    passes = {name: PassTime(1.0, 1.0, 1.0, 5) for name in ("gather", "gather 2", "reflect 2", "upsample 2")}
    groups = group_times(passes)
    assert (groups["indirect"], groups["upsampling_compositing"]) == (3.0, 1.0)


def test_default_rows_are_those_of_the_talk_with_every_visibility():
    rows = [tuple(getattr(row, name) for name in ROW_NAMES) for row in command.rows_of(parse())]
    assert rows == [(start, levels, samples, visibility) for visibility in ("off", "voxel", "horizon")
                    for start, levels, samples in ((2, 4, 64), (2, 4, 256), (1, 4, 64), (1, 5, 64))]


def test_other_settings_hold_for_all_rows_and_pinned_ones_make_rows_fewer(tmp_path):
    assert {row.radius for row in command.rows_of(parse("--radius", "20"))} == {20.0}
    rows = command.rows_of(parse("--visibility", "off", "--samples", "64"))
    assert [(r.start_level, r.levels, r.samples, r.visibility) for r in rows] == [
        (2, 4, 64, "off"), (1, 4, 64, "off"), (1, 5, 64, "off")]
    (tmp_path / "a.toml").write_text("samples = 7\n")
    assert {r.samples for r in command.rows_of(parse("--settings", str(tmp_path / "a.toml")))} == {7}
    (tmp_path / "b.toml").write_text('start-level = 2\nvisibility = "horizon"\n')
    rows = command.rows_of(parse("--settings", str(tmp_path / "b.toml")))
    assert {(r.start_level, r.visibility) for r in rows} == {(2, "horizon")}, "the defaults, but said"
    assert len(command.rows_of(parse("--preset", "talk-quarter-64"))) == 1
    assert len(talk_settings(Settings())) == 12


def test_sweeps_are_a_product_over_the_settings_given():
    rows = command.rows_of(parse("--sweep", "samples=16,32", "--sweep", "start-level=1,2,0", "--radius", "20",
                                 "--visibility", "horizon"))
    assert [(r.samples, r.start_level) for r in rows] == [(s, k) for s in (16, 32) for k in (1, 2, 0)]
    assert {(r.radius, r.visibility, r.levels) for r in rows} == {(20.0, "horizon", 4)}


@pytest.mark.parametrize("info", knobs(), ids=lambda info: info.name)
def test_every_setting_can_be_swept(info):
    if info.type is bool:
        text, expected = "on,off", (True, False)
    elif info.choices:
        text, expected = ",".join(info.choices), info.choices
    else:
        text, expected = f"{info.knob.low:g}", (info.type(info.knob.low),)
    assert parse_sweeps([f"{info.flag}={text}"], values.knob_value) == {info.name: expected}


@pytest.mark.parametrize("text, message", [
    ("sample=3", "no setting is called 'sample', --sweep, did you mean samples?"), ("xyzzy=1", "docs/settings.md"),
    ("samples=0", "samples cannot be 0, --sweep, give a value from 1 to 1024"), ("samples=1.5", "a whole number"),
    ("samples", "such as samples=64"), ("samples=", "such as samples=64"), ("samples=1,,2", "such as samples=64"),
    ("visibility=voxl", "did you mean voxel?"), ("temporal=2", "give on or off"), ("samples=4,4", "same value twice"),
    ("samples=nan", "samples cannot be 'nan'"), ("=3", "no setting is called ''"),
])
def test_a_bad_sweep_is_one_clear_line(text, message):
    with pytest.raises(UserError) as caught:
        command.rows_of(parse("--sweep", text))
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_sweeps_that_cannot_be():
    with pytest.raises(UserError, match="samples is swept twice"):
        command.rows_of(parse("--sweep", "samples=1", "--sweep", "samples=2"))
    with pytest.raises(UserError, match="8 levels from start level 2 do not fit an image of 64x36, --sweep"):
        command.rows_of(parse("--size", "64x36", "--sweep", "levels=2,8"))
    with pytest.raises(UserError, match="1048576 combinations"):
        swept_settings(Settings(), {"samples": range(1, 1025), "seed": range(1024)})


def test_files_are_refused_before_anything_is_measured(tmp_path):
    refused = [(["--json", "a.txt"], "ends in .json"), (["--csv", str(tmp_path / "no" / "a.csv")], "folder"),
               (["--markdown", str(tmp_path)], "folder")]
    if Path("/proc").is_dir():      # where root has the right to write, and cannot
        refused.append((["--json", "/proc/a.json"], "/proc/a.json"))
    for words, message in refused:
        with pytest.raises(UserError, match=message):
            measuring.check_files(parse(*words))
    good = measuring.check_files(parse("--json", "-", "--csv", str(tmp_path / "a.csv")))
    assert good == {"json": None, "csv": (tmp_path / "a.csv").resolve()}
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_nothing(tmp_path, monkeypatch):
    def full(self, *args, **kwargs):
        self.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_text", full)
    with pytest.raises(UserError, match="No space left on device"):
        measuring.write_files({"csv": tmp_path / "a.csv"}, {"csv": lambda: "a"})
    assert not list(tmp_path.iterdir())


def report(**changes) -> dict:
    """Two rows that differ in a setting beside the talk's."""
    def row(scale: float, **settings):
        passes = {"gbuffer": {"median_ms": 4.0, "p10_ms": 3.0, "p90_ms": 5.0},
                  "gather": {"median_ms": 2.0 * scale, "p10_ms": 1.0, "p90_ms": 3.0, "bytes": 1000, "floor_ms": 0.5,
                             "times_floor": 4.0 * scale}}
        return {"start_level": 2, "levels": 4, "samples": 64, "visibility": "off", "settings": settings,
                "passes": passes, "voxelization_ms": 0.0, "indirect_ms": 2.0 * scale, "upsampling_compositing_ms": 1.0,
                "total_ms": 1.0 + 2.0 * scale, "total_copies": 10.0 + 20.0 * scale,
                "frame_wall_ms": 8.0, "frame_p10_ms": 7.0, "frame_p90_ms": 12.0,
                "rest_ms": 0.5, "adds_up": True, "target_bytes": 78_000_000}

    return {"program": "ssil-viewer 0", "renderer": "llvmpipe | 256", "version": "4.5", "timer": "wall",
            "clock": "wall clock, since this OpenGL renders in software", "scene": "a, b.glb", "size": [64, 36],
            "frames": 5, "copy": {"median_ms": 0.1, "bytes": 10_000, "bytes_per_second": 1e8},
            "rows": [row(1.0), row(2.0, temporal=False)], **changes}


def test_every_table_of_a_file_says_renderer_and_clock():
    text = tables.to_markdown(report())
    shown = [tables.sums_table(report()), *tables.pass_tables(report())]
    assert text.count("wall clock, since this OpenGL renders in software") >= len(shown) + 1
    assert text.count("llvmpipe") >= len(shown) + 1


def test_tables_show_what_differs_and_the_time_over_the_floor():
    table = tables.sums_table(report())
    assert table.headers[0] == "start, levels, samples, visibility, temporal"
    assert [row[0] for row in table.rows] == ["1/4, 4, 64, off, temporal on", "1/4, 4, 64, off, temporal off"]
    assert table.rows[1][1:] == ("0.000", "4.00", "1.00", "5.00", "50.0", "8.00", "7.00 .. 12.0", "78")
    passes = tables.pass_tables(report())[0]
    assert passes.rows == (("gbuffer", "4.00", "4.00"), ("gather", "2.00 (4.0)", "4.00 (8.0)"))
    assert all(len(row) == len(t.headers) for t in (table, passes) for row in t.rows)


def test_csv_lines_stand_alone():
    lines = list(csv.DictReader(io.StringIO(tables.to_csv(report()))))
    assert [line["temporal"] for line in lines] == ["True", "False"]
    assert lines[1] | {"scene": "a, b.glb", "timer": "wall", "width": "64", "gather_median_ms": "4.0",
                       "gather_floor_ms": "0.5", "total_ms": "5.0", "target_bytes": "78000000"} == lines[1]


def test_json_has_no_numbers_that_json_has_not():
    assert json.loads(tables.to_json(report()))["rows"][0]["indirect_ms"] == 2.0
    with pytest.raises(ValueError):
        tables.to_json(report(frames=math.nan))


def test_a_row_that_does_not_add_up_is_pointed_out():
    bad = report()
    bad["rows"][1]["adds_up"] = False
    assert not any("add up" in note for note in tables.notes(report()))
    assert any("In 1 row the passes do not add up" in note for note in tables.notes(bad))
    bad["rows"][1]["adds_up"] = None
    assert not any("do not add up" in note for note in tables.notes(bad))
    assert any("In 1 row handing over its commands" in note for note in tables.notes(bad))


def test_in_a_terminal_renderer_and_clock_stand_once_ahead_of_short_titles(capsys):
    shown = [tables.sums_table(report()), *tables.pass_tables(report())]
    measuring.print_tables(tables.heading_lines(report()), shown, tables.notes(report()))
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["a, b.glb, 64x36, llvmpipe | 256, OpenGL 4.5",
                         "Times are by wall clock, since this OpenGL renders in software."]
    assert sum("wall clock" in line for line in lines) == sum("llvmpipe" in line for line in lines) == 1
    assert [lines.count(table.title) for table in shown] == [1, 1]


def test_lines_in_a_file_are_not_broken(capsys):
    heading, note = ("renderer " * 40).strip(), ("a sentence that goes on " * 12).strip()
    table = tables.Table("Title", ("a", "b"), (("1", "2"),), ("about the table " * 20).strip())
    measuring.print_tables([heading], [table], [note])
    assert {heading, note, table.note} <= set(capsys.readouterr().out.splitlines())


def test_the_rows_of_a_frame_on_software_fit_into_a_hundred_columns():
    bench = report()
    bench["rows"] = [{**bench["rows"][0], "start_level": 2, "samples": 256, "visibility": "horizon",
                      "voxelization_ms": 29.31, "indirect_ms": 403.6, "upsampling_compositing_ms": 21.44,
                      "total_ms": 454.2, "total_copies": 112.3, "frame_wall_ms": 612.3, "frame_p10_ms": 46.62,
                      "frame_p90_ms": 51.85, "target_bytes": 105_300_000}]
    table = tables.sums_table(bench)
    columns = list(zip(table.headers, *table.rows))
    widths = measuring._widths(columns, 100)
    assert all(width >= len(cell) for (_, *cells), width in zip(columns, widths) for cell in cells), "whole cells"
    narrow = measuring._widths(columns, 80)
    assert all(width >= len(word) for cells, width in zip(columns, narrow) for cell in cells for word in cell.split())
    for room, found in ((100, widths), (80, narrow)):
        assert sum(found) + 2 * (len(found) - 1) <= room


def test_what_a_floor_and_a_copy_are_is_said_in_a_line_each():
    first, *passes = tables.pass_tables(report(rows=[*report()["rows"]] * 3))
    assert not first.note and "floor" in passes[-1].note and len(passes[-1].note) <= 100
    assert [note for note in tables.notes(report()) if "copies" in note] == [
        "copies: the total in copies of an image of this size, 0.100 ms each here (0.1 GB/s)."]
    assert passes[-1].note in tables.to_markdown(report())


def test_rows_and_lines_tell_totals_in_copies():
    table = tables.sums_table(report())
    assert [row[table.headers.index("copies")] for row in table.rows] == ["30.0", "50.0"]
    assert [row["total_copies"] for row in csv.DictReader(io.StringIO(tables.to_csv(report())))] == ["30.0", "50.0"]


def test_the_sums_are_the_talks():
    assert TALK == ("voxelization", "indirect", "upsampling_compositing")


def test_the_documentation_says_which_pass_counts_where():
    text = (Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    for group, names in GROUPS.items():
        title = group.replace("_", " & ")
        line = next(line for line in text.splitlines() if line.startswith(f"| {title}"))
        assert [word for word in line.split("`") if word.isidentifier()] == list(names), group


@pytest.mark.parametrize("room, expected", [(80, [14, 12]), (30, [14, 12]), (26, [14, 8]), (16, [6, 8])])
def test_tables_break_headers_before_cells_and_never_numbers(room, expected):
    columns = [("start, levels", "1/4, 4, 64 abc"), ("compo & sits", "12345.67")]
    assert measuring._widths(columns, room) == expected


def test_rows_in_a_narrow_terminal_take_as_few_lines_as_fit():
    columns = [("start, levels, samples, visibility", "1/4, 4, 64, horizon"), ("p10 .. p90", "46.62 .. 51.85")]
    assert [measuring._widths(columns, room) for room in (40, 37, 25, 23, 19)] == \
        [[19, 14], [19, 14], [11, 8], [11, 8], [10, 5]]
