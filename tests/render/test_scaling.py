"""How times scale: that loads are what they say, that pictures stay, and that verdicts follow. Never a magnitude."""

from __future__ import annotations

import csv
import io
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.commands import bench as command
from ssil_viewer.errors import UserError
from ssil_viewer.headless import render_frames
from ssil_viewer.measure import plots, scaling, tables
from ssil_viewer.measure.variations import with_lights, with_triangles
from ssil_viewer.scene import load_scene
from ssil_viewer.scene.model import Light
from ssil_viewer.settings import Settings
from tests import scenes
from tests.unit.test_bench_parts import parse

CAMERA = scenes.CORNELL_CAMERA


@pytest.mark.parametrize("name", ["cornell", "glossy"])
def test_more_triangles_show_the_same_picture(make_renderer, name):
    """To where an edge passes so close to a pixel's centre that rounding decides: a few in a thousand."""
    scene = load_scene(f"builtin:{name}")
    many = with_triangles(scene, 30 * scene.triangle_count)
    assert many.triangle_count == 25 * scene.triangle_count, "the square that comes nearest"
    images = []
    for shown in (scene, many):
        renderer = make_renderer(shown, (96, 54), samples=8)
        render_frames(renderer, shown.cameras[0], 1)
        images.append({buffer: renderer.read(buffer) for buffer in ("view_depth", "normal", "albedo", "emission")})
    for buffer in images[0]:
        apart = np.abs(images[0][buffer] - images[1][buffer]) > 2e-2 * np.abs(images[0][buffer]).max()
        assert apart.mean() < 5e-3, buffer


def test_triangles_are_cut_in_their_plane_into_equal_parts():
    one = replace(scenes.cornell().meshes[0].primitives[0])
    scene = scenes.scene((one,), scenes.cornell().materials)
    cut = with_triangles(scene, 9 * len(one.indices)).meshes[0].primitives[0]
    a, b, c = (cut.positions[cut.indices[:, i]].astype(np.float64) for i in range(3))
    areas = np.cross(b - a, c - a) / 2
    assert len(cut.indices) == 9 * len(one.indices)
    assert np.allclose(areas, areas[0], atol=1e-6), "same size, same side"
    x, y, z = (one.positions[one.indices[0, i]].astype(np.float64) for i in range(3))
    assert np.allclose(areas.sum(0), len(one.indices) * np.cross(y - x, z - x) / 2, atol=1e-5)
    assert np.allclose(np.linalg.norm(cut.normals, axis=1), 1.0, atol=1e-6)


def test_neighbours_share_the_points_of_their_edge():
    room = scenes.cornell()
    cut = with_triangles(room, 49 * room.triangle_count).meshes[0].primitives[0]
    # A rectangle of two triangles cut by 7: 8 x 8 different points
    assert len(np.unique(cut.positions, axis=0)) == 64


def test_more_lights_shine_as_one(make_renderer):
    light = Light("point", intensity=3.0, position=(0.0, 0.9, 0.0))
    many = with_lights((light,), 16)
    assert len(many) == 16 and sum(one.intensity for one in many) == pytest.approx(3.0)
    assert len(with_lights((light,) * 3, 16)) == 15
    images = []
    for lights in ((light,), with_lights((light,), 4), with_lights((light,), scaling.LIGHTS.full[-1])):
        renderer = make_renderer(replace(scenes.cornell(), lights=lights), (48, 27), samples=4)
        renderer.render(CAMERA)
        assert not renderer.warnings, "all cast shadows"
        images.append(renderer.read("direct"))
    one, few, most = images
    assert np.allclose(one, few, rtol=2e-3, atol=1e-4), "to the rounding of half floats"
    # 256 shadow maps are an eighth as wide as one: edges of shadows move, the rest stays
    assert np.mean(np.abs(one - most) > 0.02 * one.max()) < 0.1
    assert most.mean() == pytest.approx(one.mean(), rel=0.02)


@pytest.mark.parametrize("rule, points, expected", [
    ("flat", [(1, 10.0), (100, 10.4), (1000, 9.9)], 10.4 / 9.9), ("flat", [(5, 2.0)], 1.0),
    ("linear", [(1, 1.0), (2, 2.0), (4, 4.0)], 1.0), ("linear", [(1, 1.0), (2, 1.5), (4, 4.0)], 8 / 6),
    ("linear", [(1, 5.0), (10, 6.0)], 0.12), ("linear", [(1, 1.0)], 1.0),
])
def test_growth(rule, points, expected):
    assert scaling.growth(rule, points) == pytest.approx(expected)


@pytest.fixture(scope="module")
def few_points():
    """So few points that all series take seconds on software OpenGL."""
    patch = pytest.MonkeyPatch()
    for name, values in {"TRIANGLES": (100, 1000), "LIGHTS": (1, 3), "HEIGHTS": (9, 18), "SAMPLES": (1, 4),
                         "LEVELS": (1, 2)}.items():
        patch.setattr(scaling, name, scaling.Points((), values))
    yield
    patch.undo()


@pytest.fixture
def report(make_renderer, few_points):
    renderer = make_renderer(scenes.cornell(), (32, 18), samples=2)
    scene, settings = renderer.scene, renderer.settings
    heard = []
    found = scaling.measure(renderer, CAMERA, quick=True, frames=2,
                            progress=lambda what, done, total: heard.append((what, done, total)))
    assert (renderer.scene, renderer.lights, renderer.size) == (scene, scene.lights, (32, 18)), "as it was"
    assert renderer.settings == settings
    assert [done for _, done, _ in heard] == list(range(20)) and heard[-1][2] == 20
    return found


def test_a_report_has_every_series_with_its_loads_and_verdict(report, tmp_path):
    series = {one["name"]: one for one in report["series"]}
    assert list(series) == ["triangles", "lights", "image size", "samples", "levels"]
    loads = {name: [point["load"] for point in one["points"]] for name, one in series.items()}
    own = scenes.cornell().triangle_count
    assert loads == {"triangles": [own * round((n / own) ** 0.5) ** 2 for n in (100, 1000)], "lights": [1, 3],
                     "image size": [16 * 9, 32 * 18], "samples": [1, 4], "levels": [1, 1.25]}
    for one in series.values():
        assert one["limit"] == (1.05 if one["rule"] == "flat" else 1.1)
        assert one["holds"] == (one["worst"] <= one["limit"])
        assert one["worst"] == scaling.growth(one["rule"], [(p["load"], p["least_ms"]) for p in one["points"]])
        assert all(point["repeats_within"] >= 1 for point in one["points"])
        assert all(0 < point["least_ms"] <= point["frame_wall_ms"] for point in one["points"])
    text = tables.to_markdown(report, scaling.report_tables(report), scaling.verdicts(report))
    assert text.count(report["clock"]) == 7, "in the heading, in every table and in the verdicts"
    lines = list(csv.DictReader(io.StringIO(tables.csv_text(scaling.csv_lines(report)))))
    assert len(lines) == 10 and lines[3]["series"] == "lights" and lines[3]["load"] == "3"
    for ending in (".svg", ".png", ".pdf"):
        pytest.importorskip("matplotlib")
        written = []
        for _ in range(2):
            plots.write(tmp_path / f"a{ending}", report)
            written.append((tmp_path / f"a{ending}").read_bytes())
        assert len(written[0]) > 1000 and written[0] == written[1], ending
    assert "triangles: flat" in (tmp_path / "a.svg").read_text()


def test_a_verdict_says_when_the_machine_is_too_busy_to_tell():
    def verdict(worst, repeats_within):
        series = {"name": "lights", "rule": "flat", "limit": 1.05, "worst": worst, "holds": worst <= 1.05,
                  "repeats_within": repeats_within}
        return scaling.verdicts({"series": [series], "left_out": [], "clock": "clock"})[0]

    assert verdict(1.02, 1.5) == "lights: flat within 5 %? yes, the slowest takes 2.0 % longer than the fastest"
    assert verdict(1.2, 1.01) == "lights: flat within 5 %? no, the slowest takes 20.0 % longer than the fastest"
    assert "differ by up to 50 %, so the machine is too busy" in verdict(1.2, 1.5)
    assert "busy" not in verdict(3.0, 1.06), "no disturbance of 6 % makes it three times as slow"


def test_series_that_the_scene_has_no_points_for(make_renderer, few_points, monkeypatch):
    """As many lights as the largest point already, none at all, and no indirect light."""
    light = scenes.cornell().lights[0]
    monkeypatch.setattr(scaling, "LIGHTS", scaling.Points((), (1, 16)))
    for lights, loads in (((light,) * 9, [9, 36]), ((light,), [1, 16])):
        renderer = make_renderer(replace(scenes.cornell(), lights=lights), (16, 9), samples=1)
        found = scaling.measure(renderer, CAMERA, quick=True, frames=1, only=("lights",))
        assert [point["load"] for point in found["series"][0]["points"]] == loads and not found["left_out"]
    renderer = make_renderer(replace(scenes.cornell(), lights=()), (16, 9), samples=1)
    found = scaling.measure(renderer, CAMERA, quick=True, frames=1, only=("lights",))
    assert not found["series"] and scaling.verdicts(found)[0] == "lights: the scene has none"
    renderer.set_settings(Settings(bounces=0))
    with pytest.raises(UserError, match="without a bounce there is no indirect light"):
        scaling.measure(renderer, CAMERA, quick=True, frames=1)


def test_flags_that_do_not_go_together(monkeypatch):
    for words, message in ((["--quick"], "--quick, add --scaling"), (["--plots", "a.svg"], "--plots, add --scaling"),
                           (["--scaling", "--sweep", "samples=1"], "either --sweep or --scaling"),
                           (["--scaling", "--plots", "a.gif"], "ends in .svg, .png or .pdf")):
        with pytest.raises(UserError, match=message):
            command.run(parse(*words))
    monkeypatch.setattr(plots.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UserError, match="plots need matplotlib, --plots, install it"):
        plots.require()


@pytest.mark.slow
def test_the_command(tmp_path):
    words = ["bench", "--scaling", "--quick", "--size", "32x18", "--frames", "1", "--samples", "4", "--json", "a.json"]
    done = subprocess.run([sys.executable, "-m", "ssil_viewer", *words], cwd=tmp_path, capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    assert "builtin:cornell, 32x18" in done.stdout and "triangles: flat within 5 %?" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
