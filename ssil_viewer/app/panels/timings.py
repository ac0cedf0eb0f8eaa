"""The table of pass times."""

from __future__ import annotations

from imgui_bundle import imgui

from ssil_viewer.app.panels import widgets
from ssil_viewer.gpu.timers import PassTime, Timings

_NUMBERS = 3


def draw(timings: Timings, frame_seconds: float) -> None:
    """Median, spread and share of every pass, the frame, and which clock measured it.

    Args:
        frame_seconds: Wall time between two frames of the window, which includes panels and waiting.
    """
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit
    if imgui.begin_table("timings", 1 + _NUMBERS, flags):
        for name in ("Pass", "Median", "p10 .. p90", "Share"):
            imgui.table_setup_column(name)
        imgui.table_headers_row()
        total = sum(time.median_ms for time in timings.passes.values() if time.count)
        for name, time in timings.passes.items():
            _row(name, time, total)
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.separator()
        _row("frame" if timings.waits else "submitting", timings.frame, 0.0)
        imgui.end_table()
    clock = "GPU timer queries" if timings.source == "gpu" else "wall clock (software OpenGL)"
    rate = f"{1 / frame_seconds:.1f} fps" if frame_seconds else "n/a"
    widgets.muted(f"ms, {clock}\nwindow: {1000 * frame_seconds:.1f} ms, {rate}")


def _row(name: str, time: PassTime, total: float) -> None:
    cells = ["n/a"] * _NUMBERS
    if time.count:
        cells = [f"{time.median_ms:.2f}", f"{time.p10_ms:.2f} .. {time.p90_ms:.2f}",
                 f"{100 * time.median_ms / total:.0f} %" if total > 0.0 else ""]
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.text(name)
    for cell in cells:
        imgui.table_next_column()
        widgets.right_aligned(cell)

