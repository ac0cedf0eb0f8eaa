"""The settings, generated from their definitions: a new setting appears here by itself."""

from __future__ import annotations

import dataclasses
from itertools import groupby
from typing import Any

from imgui_bundle import imgui

from ssil_viewer.app import keys
from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.idle_settings import found_in, lacking
from ssil_viewer.settings import KnobInfo, Need, Settings, knobs, presets

# Beyond this many steps a slider cannot be set to a value, and imgui refuses ranges of 2^31.
_MOST_SLIDER_STEPS = 1 << 20
_IDLE_ALPHA = 0.45
_AFFECTS = {"display": "the display only", "history": "restarts the temporal filter",
            "resources": "allocates the buffers anew"}


def draw(state: AppState, actions: Actions) -> None:
    """All settings, group by group."""
    found = found_in(state.scene)
    for group, infos in groupby(sorted(knobs(), key=_group_order), key=lambda info: info.knob.group):
        imgui.separator_text(group)
        for info in infos:
            row(state, actions, info, lacking(info.name, state.settings, found))
            if info.name == "exposure":
                if imgui.button("Auto exposure"):
                    actions.meter_exposure()
                widgets.hint(f"Choose the exposure from the picture ({keys.shortcut('meter_exposure')})")
    imgui.spacing()
    if imgui.button("Reset all"):
        actions.set_settings(Settings())
    imgui.same_line()
    widgets.muted("right click: default")


def draw_menu(actions: Actions) -> None:
    """Entries of the menu "Settings"."""
    for text, action in (("Undo", "undo"), ("Redo", "redo")):
        if imgui.menu_item_simple(text, keys.shortcut(action)):
            getattr(actions, action)()
    imgui.separator_text("Presets")
    for name, path in presets().items():
        if imgui.menu_item_simple(name):
            actions.use_preset(name)
        if imgui.is_item_hovered():
            widgets.hint(path.read_text(encoding="utf-8").strip())
    imgui.separator_text("Files")
    if imgui.menu_item_simple("Save to a file"):
        actions.save_settings()
    widgets.hint("What differs from the defaults, as .toml with the time in its name, in the working directory")
    if imgui.menu_item_simple("Load settings file...", keys.shortcut("browse_scene")):
        actions.browse_scene()
    if imgui.menu_item_simple("Reset all"):
        actions.set_settings(Settings())


def edited(settings: Settings, info: KnobInfo, value: Any) -> tuple[Settings, str]:
    """New settings with one value changed, or the old ones and the reason why not.

    Numbers are checked, never clamped: sliders stay in range by themselves, typed values may not.
    """
    try:
        return dataclasses.replace(settings, **{info.name: info.check(value)}), ""
    except UserError as error:
        return settings, str(error)


def tooltip(info: KnobInfo, lacks: Need | None = None) -> str:
    """What the setting does, its range, default and flag, what a change costs, and why it has no effect now."""
    knob = info.knob
    lines = [info.text]
    if lacks is not None:
        lines.insert(0, f"No effect now: it needs {lacks}.")
    if knob.low is not None and knob.high is not None:
        lines.append(f"Range {knob.low:g} to {knob.high:g} {knob.unit}".rstrip())
    default = str(info.default).lower() if info.type is bool else f"{info.default}"
    lines.append(f"Default {default}; a change {'concerns ' if knob.affects == 'display' else ''}"
                 f"{_AFFECTS[knob.affects]}")
    lines.append(info.flag if info.type is not bool else f"{info.flag} / --no-{info.flag.removeprefix('--')}")
    return "\n".join(lines)


def number_format(info: KnobInfo) -> str:
    """How a slider writes its value, in printf's language."""
    unit = info.knob.unit.replace("%", "%%")
    return f"{'%d' if info.type is int else '%.2f'} {unit}".rstrip()


def _group_order(info: KnobInfo) -> int:
    """Groups in the order in which the definition mentions them first."""
    return list(dict.fromkeys(i.knob.group for i in knobs())).index(info.knob.group)


def row(state: AppState, actions: Actions, info: KnobInfo, lacks: Need | None = None) -> None:
    """Name and widget of one setting; faint where it lacks something, as somebody may set it beforehand."""
    value = getattr(state.settings, info.name)
    text = tooltip(info, lacks)
    imgui.push_style_var(imgui.StyleVar_.alpha, _IDLE_ALPHA if lacks else 1.0)
    reset = widgets.label(widgets.title_of(info.name), text, marked=value != info.default)
    changed, new = _widget(info, value)
    imgui.pop_style_var()
    if imgui.is_item_clicked(imgui.MouseButton_.right):
        reset = True
    widgets.hint(text)
    if reset:
        changed, new = True, info.default
    if changed:
        settings, problem = edited(state.settings, info, new)
        actions.set_settings(settings)
        if problem:
            state.say(problem, "error")


def _widget(info: KnobInfo, value: Any) -> tuple[bool, Any]:
    name, knob = f"##{info.name}", info.knob
    flags = imgui.SliderFlags_.logarithmic if knob.log else imgui.SliderFlags_.none
    if info.type is bool:
        return imgui.checkbox(name, value)
    if info.type is str:
        new = widgets.choice(info.name, value, info.choices)
        return new != value, new
    if info.type is int and knob.high - knob.low > _MOST_SLIDER_STEPS:
        return imgui.input_int(name, value)
    if info.type is int:
        changed, new = imgui.slider_int(name, value, int(knob.low), int(knob.high), number_format(info), flags)
        if knob.low <= new <= knob.high:    # what is typed may lie outside, and is refused then
            new = info.nearest(new)
        return changed and new != value, new
    return imgui.slider_float(name, value, knob.low, knob.high, number_format(info), flags)
