"""Times of passes: what counts, that nothing stalls, and that the parts add up to the whole. Never a magnitude."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ssil_viewer.gpu import timers
from ssil_viewer.gpu.timers import RING, WARM_UP_FRAMES, PassTime, PassTimers, Timings
from ssil_viewer.headless import read_display, render_frames
from ssil_viewer.passes import FRAME
from tests import scenes

CAMERA = scenes.CORNELL_CAMERA


class FakeGpu:
    """A GPU whose queries know when they are read: `elapsed` of a query is the number of its frame in nanoseconds."""

    def __init__(self) -> None:
        self.frame = 0
        self.open = 0
        self.made = 0
        self.finishes = 0
        self.ages: list[int] = []

    def finish(self) -> None:
        self.finishes += 1

    def query(self, time: bool) -> FakeQuery:
        self.made += 1
        return FakeQuery(self)


class FakeQuery:
    def __init__(self, gpu: FakeGpu) -> None:
        self._gpu = gpu
        self._written: int | None = None

    def __enter__(self) -> None:
        assert self._gpu.open == 0, "time queries do not nest"
        self._gpu.open += 1
        self._written = self._gpu.frame

    def __exit__(self, *_: object) -> None:
        self._gpu.open -= 1

    @property
    def elapsed(self) -> int:
        self._gpu.ages.append(self._gpu.frame - self._written)
        return int(self._written * 1e6)


def run(gpu: FakeGpu, passes: PassTimers, frames: int, names=("a", "b")) -> None:
    for _ in range(frames):
        with passes.frame():
            for name in names:
                with passes.measure(name):
                    pass
        gpu.frame += 1


def test_queries_are_read_frames_later_and_used_again():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    run(gpu, passes, 20)
    assert gpu.ages and min(gpu.ages) >= RING - 1
    assert gpu.made == 2 * RING
    assert gpu.finishes == 0, "nothing stalls"
    assert passes.timings(("a", "b")).passes["a"].count == 20 - WARM_UP_FRAMES - (RING - 1)


def test_warm_up_frames_do_not_count_and_each_time_is_of_its_own_frame():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    run(gpu, passes, WARM_UP_FRAMES + 4)
    passes.drain()
    # Frames 3, 4, 5 and 6, which took so many milliseconds
    assert passes.timings(("a",)).passes["a"] == PassTime(4.5, pytest.approx(3.3), pytest.approx(5.7), 4)


def test_a_restart_forgets_what_is_in_flight():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    run(gpu, passes, 10)
    passes.restart()
    run(gpu, passes, WARM_UP_FRAMES + 2)
    passes.drain()
    assert passes.count == 2
    assert passes.timings(("a",)).passes["a"].median_ms == 10 + WARM_UP_FRAMES + 0.5


def test_a_disturbed_frame_is_left_out_and_no_other():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    run(gpu, passes, 5)         # frames 3 and 4 count
    passes.disturb()
    run(gpu, passes, 2)         # 6
    with passes.frame(), passes.measure("a"):
        passes.disturb()        # not 7
    gpu.frame += 1
    run(gpu, passes, 1)         # 8
    passes.drain()
    assert passes.count == 4
    assert passes.timings(("a",)).passes["a"].median_ms == 5.0


def test_a_pass_that_runs_twice_counts_with_its_sum():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    run(gpu, passes, WARM_UP_FRAMES + 1, names=("a", "b", "a"))
    passes.drain()
    found = passes.timings(("a", "b")).passes
    assert found["a"].median_ms == 2 * found["b"].median_ms == 2 * WARM_UP_FRAMES


def test_an_error_in_a_frame_leaves_it_out_and_goes_on():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    run(gpu, passes, 5)
    with pytest.raises(KeyError), passes.frame(), passes.measure("a"):
        raise KeyError
    run(gpu, passes, 1)
    passes.drain()
    assert passes.count == 3


def test_only_so_many_frames_are_kept():
    gpu = FakeGpu()
    passes = PassTimers(gpu, software=False)
    passes.window = 5
    run(gpu, passes, 20)
    passes.drain()
    assert passes.timings(("a",)).passes["a"].count == passes.timings(()).frame.count == 5
    assert passes.timings(("a",)).passes["a"].median_ms == 17


def test_a_frame_that_waits_ends_when_the_gpu_does(monkeypatch):
    """The clock moves by 2 ms when the frame is submitted and by 30 ms in `finish` while there is work."""
    now = [0.0]
    monkeypatch.setattr(timers.time, "perf_counter", lambda: now[0])

    class SlowGpu(FakeGpu):
        def finish(self) -> None:
            now[0] += 0.03 * self.open_work
            self.open_work = 0

    for waits in (True, False):
        gpu = SlowGpu()
        gpu.open_work = 0
        passes = PassTimers(gpu, software=False)
        passes.waits = waits
        for _ in range(WARM_UP_FRAMES + 2):
            with passes.frame(), passes.measure("a"):
                now[0] += 0.002
                gpu.open_work = 1
        passes.drain()
        found = passes.timings(("a",))
        assert found.waits == waits
        assert found.submit.median_ms == pytest.approx(2)
        assert found.frame.median_ms == pytest.approx(32 if waits else 2)


def test_what_adding_up_means():
    def timings(source, frame, submit, *passes):
        spread = {str(i): PassTime(t, t, t, 5) for i, t in enumerate(passes)}
        taken = PassTime(submit, submit, submit, 5) if submit else PassTime()
        rest = frame - sum(passes)
        return Timings(source, spread, PassTime(frame, frame, frame, 5), taken, PassTime(rest, rest, rest, 5), True)

    assert timings("wall", 10.0, 0, 5.0, 4.5).adds_up()
    assert not timings("wall", 10.0, 0, 5.0, 3.0).adds_up(), "a fifth is in no pass"
    assert not timings("wall", 10.0, 0, 9.0, 3.0).adds_up(), "passes take longer than their frame"
    assert timings("gpu", 10.0, 4.0, 4.0, 2.5).adds_up(), "commands were handed over before the work began"
    assert not timings("gpu", 10.0, 4.0, 2.0, 2.0).adds_up(), "queries miss some work"
    assert not timings("gpu", 10.0, 4.0, 20.0).adds_up()
    assert timings("gpu", 4.0, 3.8, 0.0).adds_up() is None, "to so long a submission passes of any length would fit"
    assert timings("gpu", 4.0, 3.8, 5.0).adds_up() is False


@pytest.mark.parametrize("settings", [{}, {"visibility": "voxel"}], ids=["off", "voxel"])
def test_the_passes_add_up_to_the_frame(make_renderer, settings):
    """Within a tenth of the frame's wall time. A median frame of several, as another process may take a turn."""
    renderer = make_renderer(scenes.cornell(), (480, 270), samples=16, **settings)
    renderer.timers.waits = True
    render_frames(renderer, CAMERA, WARM_UP_FRAMES + 7)
    renderer.timers.drain()
    timings = renderer.timings
    assert timings.frame.count == 7
    assert all(time.count == 7 for time in timings.passes.values())
    assert timings.adds_up(0.1), timings


def test_every_pass_that_runs_has_a_time(make_renderer):
    scene = scenes.cornell()
    shiny = replace(scene, materials=tuple(replace(m, roughness=0.3, specular=1.0) for m in scene.materials))
    renderer = make_renderer(shiny, (32, 18), samples=4)
    render_frames(renderer, CAMERA, WARM_UP_FRAMES + RING)
    runner = renderer._runner      # its settings leave out what the scene has no use for
    assert set(renderer.timings.passes) == {p.name for p in FRAME if p().runs(runner.settings, runner.features)}


def test_frames_after_a_readback_or_a_resize_do_not_count(make_renderer):
    renderer = make_renderer(scenes.cornell(), (32, 18), samples=4)
    render_frames(renderer, CAMERA, WARM_UP_FRAMES + 2)
    assert renderer.timers.count == 2
    for readback in (lambda: renderer.read("direct"), lambda: renderer.read_stored("albedo"),
                     lambda: read_display(renderer)):
        readback()
        render_frames(renderer, CAMERA, 1)
    assert renderer.timers.count == 2
    render_frames(renderer, CAMERA, 1)
    assert renderer.timers.count == 3
    renderer.resize((40, 20))
    render_frames(renderer, CAMERA, WARM_UP_FRAMES)
    assert renderer.timers.count == 0


def test_a_frame_that_compiles_does_not_count(make_renderer):
    renderer = make_renderer(scenes.cornell(), (32, 18), samples=4)
    render_frames(renderer, CAMERA, WARM_UP_FRAMES + 1)
    renderer.set_settings(renderer.settings.replaced({"show": "direct"}))    # drops nothing, but is another program
    render_frames(renderer, CAMERA, 2)
    assert renderer.timers.count == 2


@pytest.mark.parametrize("waits", [False, True])
def test_timer_queries_work_in_the_real_frame(make_renderer, context, waits):
    """Also on software OpenGL, where what they say means nothing: no error, none nested, none made after the ring."""
    renderer = make_renderer(scenes.cornell(), (32, 18), samples=4, visibility="voxel", bounces=2)
    runner = renderer._runner
    runner.timers = PassTimers(context, software=False)
    runner.timers.waits = waits
    render_frames(renderer, CAMERA, WARM_UP_FRAMES + 6)
    made = len(runner.timers._free) + sum(len(record.queries) for record in runner.timers._in_flight)
    render_frames(renderer, CAMERA, 6)
    assert made == len(runner.timers._free) + sum(len(record.queries) for record in runner.timers._in_flight)
    runner.timers.drain()
    timings = renderer.timings
    assert timings.source == "gpu" and timings.waits == waits
    assert {time.count for time in timings.passes.values()} == {12} == {timings.submit.count}
    assert {"voxelize", "gather", "gather 2"} <= set(timings.passes)
    assert all(0 <= time.median_ms < 1e3 for time in timings.passes.values())
    assert 0 < timings.submit.median_ms <= timings.frame.median_ms
