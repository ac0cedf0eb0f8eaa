"""Every key and mouse action, once: what the window obeys, the help panel lists and docs/window.md shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Iterator


@dataclass(frozen=True)
class Chord:
    """A key with its modifiers.

    Attributes:
        key: Name of the key in moderngl-window's `keys`, such as "F12" or "A".
    """

    key: str
    ctrl: bool = False
    shift: bool = False


@dataclass(frozen=True)
class Binding:
    """One line of the help.

    Attributes:
        keys: As shown to people, alternatives separated by " or ".
        text: What happens.
        group: Heading in the help.
        action: Name of the method of `Actions` that is called; empty where the mouse or held keys do it.
        chords: The keys that trigger the action.
        digit: The action gets the digit of the key.
    """

    keys: str
    text: str
    group: str
    action: str = ""
    chords: tuple[Chord, ...] = ()
    digit: bool = False


_DIGITS = tuple(f"NUMBER_{digit}" for digit in range(1, 10))

BINDINGS: tuple[Binding, ...] = (
    Binding("B", "Show direct and indirect light together", "Image", "show_both", (Chord("B"),)),
    Binding("D", "Show direct light only (not while flying: there D moves)", "Image", "show_direct", (Chord("D"),)),
    Binding("I", "Show indirect light only", "Image", "show_indirect", (Chord("I"),)),
    Binding("L", "Next of both, direct, indirect, glossy", "Image", "show_next", (Chord("L"),)),
    Binding("M", "Choose the exposure from the picture", "Image", "meter_exposure", (Chord("M"),)),
    Binding("[ or ]", "Previous or next buffer in place of the image", "Image", "step_buffer_back",
            (Chord("LEFT_BRACKET"),)),
    Binding(", or .", "Finer or coarser mip level of that buffer", "Image", "step_level_down", (Chord("COMMA"),)),
    Binding("R", "Compare with no reference, with R1, with R2", "Image", "next_reference", (Chord("R"),)),
    Binding("V", "Of the reference, the error or the image", "Image", "toggle_error", (Chord("V"),)),
    Binding("K", "Our image left of a divider, or the reference alone", "Image", "toggle_split", (Chord("K"),)),
    Binding("Ctrl+B", "Keep the settings as B and show them beside those of now, A; or end that", "Image",
            "keep_settings", (Chord("B", ctrl=True),)),
    Binding("X", "Values under the cursor on and off", "Image", "toggle_inspector", (Chord("X"),)),
    Binding("F12", "Save the image as PNG, with settings, camera and lights inside", "Image", "save_image",
            (Chord("F12"),)),
    Binding("Shift+F12", "Save the window as PNG, with the panels", "Image", "save_window",
            (Chord("F12", shift=True),)),

    Binding("C", "Change between orbiting and flying", "Camera", "toggle_camera_mode", (Chord("C"),)),
    Binding("F", "Frame the whole scene, beside the panel", "Camera", "frame_scene", (Chord("F"),)),
    Binding("Home", "Back to the camera that the scene was opened with", "Camera", "reset_camera", (Chord("HOME"),)),
    Binding("1 to 9", "Go to a viewpoint; at first these are the cameras of the file", "Camera",
            "recall_viewpoint", tuple(Chord(key) for key in _DIGITS), digit=True),
    Binding("Ctrl+1 to Ctrl+9", "Save the present view as a viewpoint", "Camera",
            "save_viewpoint", tuple(Chord(key, ctrl=True) for key in _DIGITS), digit=True),
    Binding("Left drag", "Orbiting: turn about the middle beside the panel. Flying: look around", "Camera"),
    Binding("Right drag", "Look around from where the camera stands", "Camera"),
    Binding("Middle drag or Shift+left drag", "Shift the view", "Camera"),
    Binding("Wheel", "Orbiting: nearer and farther. Flying: speed", "Camera"),
    Binding("Double click", "Look at that point and orbit about it", "Camera"),
    Binding("W A S D", "Flying: forward, left, back, right", "Camera"),
    Binding("Q E", "Flying: down, up", "Camera"),
    Binding("Shift", "Flying: four times as fast", "Camera"),

    Binding("P", "Pause and resume the moving light", "Scene", "pause_light", (Chord("P"),)),
    Binding("Ctrl+O", "Open a scene file", "Scene", "browse_scene", (Chord("O", ctrl=True),)),
    Binding("Ctrl+R", "Load the scene again", "Scene", "reload_scene", (Chord("R", ctrl=True),)),
    Binding("Drop a file", "Open a scene, an environment (.hdr, .exr), a file of settings or of lights (.toml), or a "
            "saved PNG with its settings, camera and lights", "Scene"),

    Binding("F1", "This help", "Program", "toggle_help", (Chord("F1"),)),
    Binding("Tab or H", "Hide and show the panels", "Program", "toggle_panels", (Chord("TAB"), Chord("H"))),
    Binding("T", "Timings on and off", "Program", "toggle_timings", (Chord("T"),)),
    Binding("Ctrl+click on a slider", "Type a value", "Program"),
    Binding("Right click on a setting", "Back to its default", "Program"),
    Binding("Ctrl+Z", "Undo the last change of settings, lights or environment, or that B was kept, swapped or ended",
            "Program", "undo", (Chord("Z", ctrl=True),)),
    Binding("Ctrl+Y or Ctrl+Shift+Z", "Redo it", "Program", "redo",
            (Chord("Y", ctrl=True), Chord("Z", ctrl=True, shift=True))),
    Binding("Escape", "Close a menu, a list, a box or this help", "Program"),
    Binding("F5", "Load the shaders again; after an error the old ones stay", "Program", "reload_shaders",
            (Chord("F5"),)),
    Binding("F11", "Full screen on and off", "Program", "toggle_fullscreen", (Chord("F11"),)),
    Binding("Ctrl+Q", "Quit", "Program", "quit", (Chord("Q", ctrl=True),)),
)

# The second key of a pair shares its line of the help with the first.
_PARTNERS: dict[Chord, str] = {
    Chord("RIGHT_BRACKET"): "step_buffer_forward",
    Chord("PERIOD"): "step_level_up",
}

MOVEMENT_KEYS: dict[str, tuple[int, int, int]] = {
    "W": (0, 0, 1), "S": (0, 0, -1), "A": (-1, 0, 0), "D": (1, 0, 0), "Q": (0, -1, 0), "E": (0, 1, 0),
}
"""Held keys while flying: right, up, forward."""


def actions() -> dict[Chord, tuple[str, int | None]]:
    """Action and digit (or None) of every chord."""
    table: dict[Chord, tuple[str, int | None]] = {chord: (name, None) for chord, name in _PARTNERS.items()}
    for binding in BINDINGS:
        for chord in binding.chords:
            table[chord] = (binding.action, int(chord.key[-1]) if binding.digit else None)
    return table


def shortcut(action: str) -> str:
    """The keys of an action as a menu shows them; empty when it has none."""
    return next((binding.keys for binding in BINDINGS if binding.action == action), "")


def groups() -> Iterator[tuple[str, list[Binding]]]:
    """The headings of the help with their lines."""
    for group in dict.fromkeys(binding.group for binding in BINDINGS):
        yield group, [binding for binding in BINDINGS if binding.group == group]


def markdown() -> str:
    """The tables of docs/window.md."""
    lines: list[str] = []
    for group, bindings in groups():
        lines += [f"### {group}", "", "| key or mouse | does |", "|---|---|"]
        lines += [f"| {binding.keys} | {binding.text} |" for binding in bindings]
        lines.append("")
    return "\n".join(lines)
