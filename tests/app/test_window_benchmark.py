"""The benchmark in the real window: one click, a table that fills, and the window as it was."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from ssil_viewer.app.panels import benchmark as panel
from ssil_viewer.errors import UserError
from tests.app.driving import NEEDS_X, picture, turn, until, windows

pytestmark = NEEDS_X


@pytest.fixture
def benchmark(viewer):
    return viewer.actions.benchmark


def test_it_fills_a_table_and_gives_the_window_back(viewer, benchmark, tmp_path):
    before = viewer.state.settings
    viewer.state.buffer, viewer.state.level = "normal", 0
    viewer.state.inspector = True      # reads back, which must not disturb every frame
    turn(viewer, 2)
    shown = picture(viewer)
    assert shown.any()
    viewer.actions.start_benchmark()
    seen = set()

    def done():
        seen.add(len(benchmark.table.rows) if benchmark.table else 0)
        return not benchmark.running

    until(viewer, done, 120)
    assert {1, 2, 3} <= seen, "row by row, while the window goes on"
    assert len(benchmark.report["rows"]) == len(benchmark.table.rows) == 12
    assert {row["samples"] for row in benchmark.report["rows"]} == {64, 256}
    turn(viewer, 3)
    assert viewer.state.settings == viewer._renderer.settings == before
    assert viewer.state.buffer == "normal"
    assert not viewer._renderer.timers.waits or viewer._renderer.capabilities.software
    assert (picture(viewer) == shown).all(), "the buffer is shown again, and is not random"
    viewer.actions.save_benchmark()
    files = {path.suffix: path for path in tmp_path.iterdir()}
    assert files.keys() == {".json", ".csv", ".md"}
    assert len(json.loads(files[".json"].read_text())["rows"]) == 12


def test_the_text_on_its_bar_can_be_read(viewer):
    def luminance(name):
        color = imgui.get_style().color_(getattr(imgui.Col_, name))
        return np.array([color.x, color.y, color.z]) ** 2.2 @ (0.2126, 0.7152, 0.0722)

    text, done, rest = (luminance(name) for name in ("text", "plot_histogram", "frame_bg"))
    assert (text + 0.05) / (done + 0.05) > 4.5, "WCAG 2, contrast of text"
    assert done > 1.5 * rest, "how far it is can be told"


def test_turns_stay_short_and_it_can_be_stopped(viewer, benchmark, monkeypatch):
    drawn = []
    original = panel.draw_table
    monkeypatch.setattr(panel, "draw_table", lambda *found: (drawn.append(time.perf_counter()), original(*found)))
    viewer.actions.start_benchmark()
    frames = []
    original_render = viewer._renderer.render
    monkeypatch.setattr(viewer._renderer, "render",
                        lambda camera: (frames.append(len(drawn)), original_render(camera)))
    turn(viewer, 12)
    assert benchmark.running and len(drawn) == 12
    assert len(set(frames)) > 6, "the panels are drawn between the frames"
    benchmark.stop()
    turn(viewer, 2)
    assert not benchmark.running
    assert viewer._renderer.settings == viewer.state.settings


def test_what_happens_meanwhile(viewer, benchmark, scene):
    """Settings that change wait for the end; another scene ends it with a message."""
    viewer.actions.start_benchmark()
    turn(viewer, 2)
    viewer.state.settings = replace(viewer.state.settings, samples=5)
    turn(viewer, 2)
    assert benchmark.running and viewer._renderer.settings.samples != 5
    viewer._renderer.set_scene(replace(scene))
    turn(viewer, 3)
    assert not benchmark.running
    assert viewer._renderer.settings.samples == 5
    assert any("the benchmark ended" in toast.text for toast in viewer.state.toasts)


def test_its_table_closes_with_the_scene_and_can_still_be_saved(viewer, benchmark, tmp_path):
    viewer.actions.start_benchmark()
    until(viewer, lambda: benchmark.report is not None, 60)
    benchmark.stop()

    def open_scene():
        viewer.actions.open_scene("builtin:cornell")
        until(viewer, lambda: not viewer.state.loading)

    assert benchmark.visible
    open_scene()
    turn(viewer, 2)
    assert not benchmark.visible and "Benchmark" not in windows()
    viewer.actions.save_benchmark()
    assert len(list(tmp_path.iterdir())) == 3
    viewer.actions.start_benchmark()
    open_scene()
    assert benchmark.visible, "it ran, and says why it ended"


def test_nothing_to_save_is_said(viewer, benchmark, tmp_path):
    with pytest.raises(UserError, match="nothing has been measured"):
        benchmark.save(tmp_path)
    viewer.actions.save_benchmark()
    assert any("nothing has been measured" in toast.text for toast in viewer.state.toasts)
    assert not list(tmp_path.iterdir())
