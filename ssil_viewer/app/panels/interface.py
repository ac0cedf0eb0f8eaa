"""The window itself: scale of panels and of the rendered image."""

from __future__ import annotations

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState

_SCALES = ("75 %", "100 %", "125 %", "150 %", "175 %", "200 %", "250 %", "300 %")


def draw(state: AppState, actions: Actions, size: tuple[int, int]) -> None:
    """Settings of the window, not of the method.

    Args:
        size: Rendered pixels.
    """
    widgets.label("Panel scale", "Size of text and panels, on top of what the monitor asks for.")
    # Steps, not a slider: a slider that resizes itself runs away under the mouse.
    scale = widgets.choice("scale", f"{100 * state.ui_scale:.0f} %", _SCALES)
    state.ui_scale = float(scale.removesuffix(" %")) / 100
    widgets.label("Image scale", "Rendered pixels per pixel of the window, along each side. Less is faster; 200 % "
                  "smooths edges by four pixels for each one, at four times the cost.")
    state.render_scale = imgui.slider_float("##render_scale", 100 * state.render_scale, 10.0, 200.0, "%.0f %%",
                                            imgui.SliderFlags_.always_clamp)[1] / 100
    widgets.label("Wait for monitor", "Vertical synchronisation: no tearing, but the frame rate follows the monitor.")
    changed, vsync = imgui.checkbox("##vsync", state.vsync)
    if changed:
        actions.set_vsync(vsync)
    widgets.label("Always render", "Render while nothing changes, so that times go on being measured. Otherwise the "
                  "window rests once the temporal filter has settled.")
    state.continuous = imgui.checkbox("##continuous", state.continuous)[1]
    widgets.muted(f"Rendering {size[0]} x {size[1]} pixels")
