"""The benchmark in the window: the talk's rows on the present view, a few frames between two drawings of the panels."""

from __future__ import annotations

import time
from datetime import datetime
from pathlib import Path
from typing import Any

from ssil_viewer import output
from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.measure import tables
from ssil_viewer.measure.bench import Bench, talk_settings
from ssil_viewer.pipeline import Renderer

_TURN = 0.03        # s of measuring between two drawings of the panels; one frame where a frame takes longer
_FRAMES = {"gpu": 60, "wall": 5}    # of each row, by clock: the window should be back soon


class WindowBenchmark:
    """Measures with the window's own renderer, whose settings and buffer come back at the end.

    Attributes:
        report: What has been measured, as `Bench.report` has it; None before the first row.
        visible: Whether the table is open.
        runs: Benchmarks that have ended; the picture is to be drawn anew after each.
    """

    def __init__(self, state: AppState, renderer: Renderer) -> None:
        self._state = state
        self._renderer = renderer
        self._bench: Bench | None = None
        self._table: tables.Table | None = None
        self.report: dict[str, Any] | None = None
        self.visible = False
        self.runs = 0

    @property
    def running(self) -> bool:
        """Whether the renderer is the benchmark's."""
        return self._bench is not None

    @property
    def progress(self) -> tuple[str, float]:
        """The row that is being measured, and the share that is done, 0 to 1."""
        if self._bench is None:
            return "", 0.0
        done, total = self._bench.progress
        return self._bench.row_name, done / total

    @property
    def table(self) -> tables.Table | None:
        """The rows measured so far."""
        return self._table

    def start(self) -> None:
        """Begin with the view and the settings of now; a benchmark that runs goes on."""
        if self.running:
            return
        self._renderer.show_buffer(None)    # drawing a buffer belongs to no pass
        clock = self._renderer.timers.source
        self._bench = Bench(self._renderer, self._state.camera.camera(), talk_settings(self._state.settings),
                            _FRAMES[clock])
        self.report = self._table = None
        self.visible = True

    def advance(self) -> bool:
        """Render some frames of the benchmark, if it runs. Call it once a turn.

        Returns:
            Whether this turn's frames were the benchmark's.
        """
        bench = self._bench
        if bench is None:
            return False
        end = time.perf_counter() + _TURN
        try:
            while not bench.done:
                bench.step()
                if len(bench.rows) > (len(self.report["rows"]) if self.report else 0):
                    self.report = bench.report()
                    self._table = tables.sums_table(self.report)
                if time.perf_counter() > end:
                    break
            else:
                self._end()
                self._state.say("Benchmark done")
        except (UserError, ShaderError) as error:
            self._end()
            self._state.say(str(error), "error")
        return True

    def stop(self) -> None:
        """End early; the rows that are measured stay."""
        if self.running:
            self._end()

    def _end(self) -> None:
        self._bench.close()
        self._bench = None
        self.runs += 1
        try:
            self._renderer.set_settings(self._state.settings)
            if self._state.buffer in self._renderer.buffers():
                self._renderer.show_buffer(self._state.buffer, self._state.level)
        except UserError:
            pass        # the window sends both again with its next frame, and says what is wrong

    def save(self, folder: Path) -> Path:
        """Write what has been measured as .json, .csv and .md.

        Returns:
            The path of the JSON file; the others differ in their ending.

        Raises:
            UserError: Nothing is measured yet, or the folder cannot be written to.
        """
        if self.report is None:
            raise UserError("nothing has been measured yet", "", "press Measure this view")
        stem = datetime.now().strftime("ssil-bench-%Y%m%d-%H%M%S")
        texts = {".json": tables.to_json, ".csv": tables.to_csv, ".md": tables.to_markdown}
        paths = {ending: output.check_target(folder / (stem + ending)) for ending in texts}
        for ending, path in paths.items():
            output.write_text(path, texts[ending](self.report))
        return paths[".json"]
