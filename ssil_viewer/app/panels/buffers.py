"""Every buffer of the frame at every level, and the values under the cursor."""

from __future__ import annotations

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState, PixelReading
from ssil_viewer.pipeline import Renderer

_IMAGE = "image"


def draw(state: AppState, actions: Actions, renderer: Renderer) -> None:
    """Choose what is shown, and see what it is."""
    buffers = renderer.buffers()
    widgets.label("Show", "In place of the image; [ and ] step through them.")
    chosen = widgets.choice("buffer", state.buffer or _IMAGE, [_IMAGE, *buffers])
    if chosen != (state.buffer or _IMAGE):
        state.buffer = None if chosen == _IMAGE else chosen
        state.level = buffers[chosen].levels[0] if chosen in buffers else 0
    info = buffers.get(state.buffer or "")
    if info:
        levels = info.levels
        if len(levels) > 1:
            widgets.label("Level", "Mip level: 0 is full resolution, each next one half; , and . step.")
            state.level = imgui.slider_int("##level", state.level, levels[0], levels[-1], "%d",
                                           imgui.SliderFlags_.always_clamp)[1]
        widgets.muted(info.meaning)
    widgets.label("Inspector (X)", "Values under the cursor. Reading them back costs time.")
    state.inspector = imgui.checkbox("##inspector", state.inspector)[1]
    if imgui.tree_node("Memory"):
        _memory(renderer)
        imgui.tree_pop()


def draw_reading(reading: PixelReading) -> None:
    """A tooltip with the values under the cursor."""
    imgui.begin_tooltip()
    imgui.text_disabled(f"pixel {reading.x}, {reading.y}")
    if imgui.begin_table("pixel", 2, imgui.TableFlags_.sizing_fixed_fit):
        for name, channels in reading.values.items():
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled(name)
            imgui.table_next_column()
            imgui.text("  ".join(f"{value:.4g}" for value in channels))
        imgui.end_table()
    imgui.end_tooltip()


def _memory(renderer: Renderer) -> None:
    sizes = renderer.target_bytes()
    if imgui.begin_table("memory", 2, imgui.TableFlags_.row_bg):
        for name, size in [*sizes.items(), ("all", sum(sizes.values()))]:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled(name)
            imgui.table_next_column()
            widgets.right_aligned(f"{size / 2**20:.2f} MiB")
        imgui.end_table()
