"""The benchmark as it runs: its promised structure, its floors, and what it leaves behind. Never a magnitude."""

from __future__ import annotations

import json
import math
import subprocess
import sys

import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.targets import level_size
from ssil_viewer.gpu.timers import WARM_UP_FRAMES
from ssil_viewer.measure import tables
from ssil_viewer.measure.bench import Bench, swept_settings, talk_settings
from ssil_viewer.measure.copy_speed import CopyMeter
from ssil_viewer.settings import Settings
from tests import scenes

CAMERA = scenes.CORNELL_CAMERA
ROW_KEYS = {"start_level", "levels", "samples", "visibility", "passes", "voxelization_ms", "indirect_ms",
            "upsampling_compositing_ms", "total_ms", "frame_wall_ms"}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The command in another process: its files and what it printed."""
    folder = tmp_path_factory.mktemp("bench")
    words = ["bench", "builtin:cornell", "--size", "64x36", "--frames", "3", "--json", "a.json", "--csv", "a.csv",
             "--markdown", "a.md"]
    done = subprocess.run([sys.executable, "-m", "ssil_viewer", *words], cwd=folder, capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    return folder, done


def test_the_json_is_as_promised(written):
    report = json.loads((written[0] / "a.json").read_text())
    assert {"renderer", "version", "timer", "scene", "size", "frames", "rows"} <= report.keys()
    assert (report["scene"], report["size"], report["frames"]) == ("builtin:cornell", [64, 36], 3)
    assert report["timer"] == ("wall" if "llvmpipe" in report["renderer"] else "gpu")
    assert len(report["rows"]) == 12
    for row in report["rows"]:
        assert row.keys() >= ROW_KEYS
        sums = row["voxelization_ms"] + row["indirect_ms"] + row["upsampling_compositing_ms"]
        assert row["total_ms"] == pytest.approx(sums)
        assert (row["voxelization_ms"] > 0) == (row["visibility"] == "voxel")
        assert row["target_bytes"] > 0 and row["frame_wall_ms"] > 0
        for name, time in row["passes"].items():
            assert 0 <= time["p10_ms"] <= time["median_ms"] <= time["p90_ms"], name


def test_the_files_and_the_terminal_show_the_same_rows(written):
    folder, done = written
    assert sorted(path.name for path in folder.iterdir()) == ["a.csv", "a.json", "a.md"]
    assert len((folder / "a.csv").read_text().splitlines()) == 13
    for text in (done.stdout, (folder / "a.md").read_text()):
        assert "1/2, 5, 64, horizon" in text
    report = json.loads((folder / "a.json").read_text())
    assert done.stdout.count(report["clock"]) == 1 and (folder / "a.md").read_text().count(report["clock"]) >= 4


def test_an_interrupted_or_failed_benchmark_writes_nothing(tmp_path):
    words = ["bench", "missing.glb", "--size", "64x36", "--json", "a.json"]
    done = subprocess.run([sys.executable, "-m", "ssil_viewer", *words], cwd=tmp_path, capture_output=True, text=True,
                          timeout=100)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_floors_count_each_declared_texel_once(make_renderer):
    """Of the copy, of a pass with one dispatch, and of the mipmap's chain; sizes by hand."""
    size = (50, 30)
    renderer = make_renderer(scenes.cornell(), size, samples=4, levels=2, start_level=1)
    with renderer.counting_bytes() as traffic:
        renderer.render(CAMERA)
    pixels = size[0] * size[1]
    first, second = (math.prod(level_size(size, level)) for level in (1, 2))
    # temporal: surface, upsample, motion, last frame's surface and irradiance, light and surface of level 1; writes
    # irradiance
    of_temporal = pixels * (8 + 4 + 8 + 8 + 8 + 8) + first * (8 + 8)
    assert traffic["temporal"] == of_temporal
    # gbuffer: surface, albedo, specular, emission, motion and the depth buffer
    assert traffic["gbuffer"] == pixels * (8 + 4 + 4 + 4 + 8 + 4)
    # gather reads surface and radiance and writes two lobes, at levels 1 and 2; before its ring it looks for blockers
    # on the surfaces of level 1
    assert traffic["gather"] == (first + second) * (8 + 4 + 8 + 8) + first * 8
    renderer.render(CAMERA)
    assert traffic["temporal"] == of_temporal, "counts only inside"


def test_the_copy_moves_every_texel_once_each_way(context, stage):
    meter = CopyMeter(context, (40, 20), stage)
    assert meter.speed is None
    for _ in range(10):
        meter.step()
    copy = meter.speed
    meter.release()
    assert 1 <= copy.time.count <= 10 - WARM_UP_FRAMES
    assert copy.bytes == 2 * 8 * 800
    assert copy.time.median_ms > 0
    assert copy.floor_ms(copy.bytes) == pytest.approx(copy.time.median_ms)
    assert copy.floor_ms(copy.bytes) == pytest.approx(copy.bytes / copy.bytes_per_second * 1e3)


def test_rows_have_their_own_settings_and_the_timers_come_back(make_renderer):
    renderer = make_renderer(scenes.cornell(), (32, 18))
    before = renderer.timers.waits, renderer.timers.window
    bench = Bench(renderer, CAMERA, swept_settings(Settings(levels=2), {"samples": (1, 2), "bounces": (0, 1)}), 2)
    heard = []
    bench.run(lambda bench: heard.append(bench.progress))
    bench.close()
    assert (renderer.timers.waits, renderer.timers.window) == before
    assert [(row.settings.samples, row.settings.bounces) for row in bench.rows] == [(1, 0), (1, 1), (2, 0), (2, 1)]
    assert all(row.timings.frame.count == 2 for row in bench.rows)
    assert heard == sorted(heard) and heard[-1][0] == heard[-1][1]
    report = bench.report()
    assert [row["indirect_ms"] > 0 for row in report["rows"]] == [False, True, False, True]
    copy = report["copy"]["median_ms"]
    assert [row["total_copies"] for row in report["rows"]] == [row["total_ms"] / copy for row in report["rows"]]
    json.loads(tables.to_json(report))


def test_the_renderer_can_be_read_after_a_benchmark(make_renderer):
    """Also where what was bound last belonged to the copy: uniforms of the frame are still its own."""
    renderer = make_renderer(scenes.cornell(), (32, 18), samples=4, levels=2, temporal=False)
    renderer.render(CAMERA)
    direct = renderer.read("direct")
    before = renderer.displayed(direct)
    assert before.std() > 1
    bench = Bench(renderer, CAMERA, [renderer.settings], 2)
    bench.run()
    bench.close()
    assert (renderer.displayed(direct) == before).all()
    assert (renderer.read("direct") == direct).all()


def test_a_change_of_scene_or_size_ends_it(make_renderer):
    renderer = make_renderer(scenes.cornell(), (32, 18), samples=1)
    for change in (lambda: renderer.resize((20, 10)), lambda: renderer.set_scene(scenes.cornell())):
        bench = Bench(renderer, CAMERA, talk_settings(Settings()), 2)
        bench.step()
        change()
        with pytest.raises(UserError, match="changed"):
            bench.step()
        bench.close()


def test_frames_that_are_always_disturbed_end_it(make_renderer):
    renderer = make_renderer(scenes.cornell(), (8, 8), samples=1)
    bench = Bench(renderer, CAMERA, [Settings(samples=1)], 2)
    with pytest.raises(UserError, match="disturbs"):
        for _ in range(200):
            bench.step()
            renderer.timers.disturb()
    bench.close()
