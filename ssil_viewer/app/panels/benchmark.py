"""The benchmark: a button, how far it is, and its table."""

from __future__ import annotations

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.benchmark import WindowBenchmark
from ssil_viewer.app.panels import widgets
from ssil_viewer.measure import tables

_PROGRESS_EM = 30.0


def draw(benchmark: WindowBenchmark, actions: Actions) -> None:
    """The part of the panel that starts and stops it."""
    if benchmark.running:
        _draw_progress(benchmark, -1.0)
        return
    if imgui.button("Measure this view"):
        actions.start_benchmark()
    widgets.hint("The four rows of the talk's timing table with visibility off, voxel and horizon, and all else as it "
                 "is set. Settings come back at the end.")
    if benchmark.report:
        imgui.same_line()
        if imgui.button("Save"):
            actions.save_benchmark()
        widgets.hint("As .json, .csv and .md into the working directory.")
        imgui.same_line()
        benchmark.visible = imgui.checkbox("Table", benchmark.visible)[1]


def draw_table(benchmark: WindowBenchmark, left: float, top: float) -> None:
    """How far it is and the rows measured so far, in a window of its own.

    Args:
        left, top: Where the image begins to be seen, in window units.
    """
    if not benchmark.visible:
        return
    em = imgui.get_font_size()
    imgui.set_next_window_pos((left + 0.6 * em, top + 0.6 * em), imgui.Cond_.appearing)
    flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_saved_settings
    expanded, benchmark.visible = imgui.begin("Benchmark", True, flags)
    if expanded:
        if benchmark.running:
            _draw_progress(benchmark, _PROGRESS_EM * em)
        table, report = benchmark.table, benchmark.report
        if table is not None and report is not None:
            imgui.text_unformatted(tables.heading(report))
            _draw(table)
            widgets.muted("\n".join([table.title, *tables.notes(report)]))
    imgui.end()


def _draw_progress(benchmark: WindowBenchmark, width: float) -> None:
    name, share = benchmark.progress
    if imgui.button("Stop"):
        benchmark.stop()
    imgui.same_line()
    imgui.progress_bar(share, (width, 0.0), name)


def _draw(table: tables.Table) -> None:
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit
    if not imgui.begin_table("rows", len(table.headers), flags):
        return
    for name in table.headers:
        imgui.table_setup_column(name)
    imgui.table_headers_row()
    for row in table.rows:
        imgui.table_next_row()
        for at, cell in enumerate(row):
            imgui.table_next_column()
            widgets.right_aligned(cell) if at else imgui.text_unformatted(cell)
    imgui.end_table()
