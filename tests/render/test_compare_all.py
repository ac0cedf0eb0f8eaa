"""`ssil-viewer compare --all`: our modes beside simpler methods, with and without a path tracer."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer import cli
from ssil_viewer.commands import compare as command
from ssil_viewer.errors import UserError
from ssil_viewer.headless import render_frames
from ssil_viewer.passes import FRAME
from ssil_viewer.peers.compare_all import compare_all
from ssil_viewer.peers.gtao import OWN, GroundTruthOcclusion, Occlusion, occlusion_frame, occlusion_settings
from ssil_viewer.peers.methods import RADII, nearest_work, occlusion_method, our_methods, single_level
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference import path_traced
from ssil_viewer.reference.compare import BLOCK, Comparison, Effort, compare
from ssil_viewer.settings import Settings
from tests import scenes

SIZE = 95, 61
SETTINGS = Settings(samples=32, start_level=1, levels=3, radius=128.0)   # reaches across the image
METHODS = ["direct_only", "constant_ambient", "gtao", "single_level_off", "single_level_horizon", "ssil_off",
           "ssil_voxel", "ssil_horizon"]
WITH_SAMPLES = METHODS[2:]
FRAMES = 2


def compared(context, settings=SETTINGS, references=("R1",), **given) -> Comparison:
    """Two timed frames: what is tested here are sums and structure."""
    effort = Effort(references, blocks=10, rays=16, path_rays=36, spp=2, seconds=60.0)
    view = dict(size=SIZE, settings=settings, camera=scenes.CORNELL_CAMERA, frames=FRAMES, context=context)
    done = compare(scenes.cornell(), effort=effort, **view, **given)
    compare_all(scenes.cornell(), done, timed_frames=2, **view)
    return done


def traced(image):
    """A path tracer that has traced this image."""
    def trace(description, tasks, progress):
        found = {"image": image, "first": image, "second": image, "spp": np.array(2)}
        light = np.ones((2, 10 * BLOCK**2, 3))
        return {"image": found, "irradiance": dict.fromkeys(
            ("all", "diffuse", "visible", "visible_mirrored", "shown"), light) | {"rays": np.array(36)}}
    return trace


def test_without_a_path_tracer(context):
    """Everything but the image's errors is there; ambient light then fits the irradiance of the reference."""
    done = compared(context)
    result = json.loads(json.dumps(done.result, allow_nan=False))
    found = result["methods"]
    assert found["clock"] and found["renderer"] and found["timed_frames"] == 2 and found["frames"] == FRAMES
    assert [row["method"] for row in found["rows"]] == METHODS
    rows = {row["method"]: row for row in found["rows"]}
    for name, row in rows.items():
        assert row["image"] is None
        assert row["irradiance"].keys() == ({"R1"} if name != "direct_only" else set())
        assert ("samples" in row) == (name in WITH_SAMPLES)
        assert row["ms"] > 0
    assert rows["ssil_horizon"]["irradiance"]["R1"]["relative_rmse"] == pytest.approx(
        result["irradiance"]["R1"]["relative_rmse"], rel=1e-6), "the same light, measured twice"
    assert rows["ssil_off"]["irradiance"]["R1"]["relative_rmse"] < rows["gtao"]["irradiance"]["R1"]["relative_rmse"]
    assert rows["gtao"]["irradiance"]["R1"]["relative_rmse"] <= rows["constant_ambient"]["irradiance"]["R1"][
        "relative_rmse"] + 0.01
    assert set(METHODS) <= done.pictures.keys()
    assert {image.shape for image in done.pictures.values()} == {(*SIZE[::-1], 3)}


def test_times_are_sums_of_the_passes_of_a_method(context):
    """With a frame each, medians are the times themselves and must add up."""
    done = Comparison({}, blocks=compare(scenes.cornell(), size=SIZE, settings=SETTINGS, frames=1, context=context,
                                         camera=scenes.CORNELL_CAMERA, effort=Effort(("R1",), blocks=4)).blocks)
    compare_all(scenes.cornell(), done, size=SIZE, settings=SETTINGS, camera=scenes.CORNELL_CAMERA, frames=1,
                timed_frames=1, context=context)
    beside = {"shadows", "gbuffer", "direct", "antialias"}
    for row in done.result["methods"]["rows"]:
        own = {name for name in row["passes"] if name not in beside}
        assert row["ms"] == pytest.approx(sum(row["passes"][name] for name in own)), row["method"]
        if row["method"] == "gtao":
            assert own == set(OWN)
        if row["method"].startswith("ssil"):
            assert {"mipmap", "gather", "upsample", "temporal", "composite"} <= own
    assert "voxelize" in next(row for row in done.result["methods"]["rows"] if row["method"] == "ssil_voxel")["passes"]


def test_equal_time_turns_everything_but_the_method_to_meet(context):
    found = compared(context, replace(SETTINGS, visibility="off")).result["methods"]["equal_time"]
    rows = {row["method"]: row for row in found["rows"]}
    assert list(rows) == WITH_SAMPLES
    assert found["to"] == "ssil_off" and rows["ssil_off"]["ms"] == found["ms"]
    assert found["ms_after"] > 0
    assert rows["ssil_off"]["samples"] == SETTINGS.samples
    assert all(row["samples"] >= 1 for row in rows.values())
    assert rows["gtao"]["samples"] == 2 * rows["gtao"]["slices"] * rows["gtao"]["steps"]


def test_the_best_radius_and_ambient_light_are_found(context):
    """Where the truth is occluded ambient light, its radius and its colour come out, and almost no error is left."""
    peer, color = GroundTruthOcclusion(), np.array((0.5, 0.3, 0.7))
    settings = replace(SETTINGS, temporal=False)
    renderer = Renderer(context, SIZE, occlusion_settings(settings), passes=occlusion_frame(peer))
    try:
        renderer.set_scene(scenes.cornell())
        renderer.render(scenes.CORNELL_CAMERA)
        depth = renderer.read("view_depth")
        radius = RADII[3] * float(np.median(depth[depth > 0]))
        peer.occlusion = Occlusion(radius)
        renderer.reset_history()
        render_frames(renderer, scenes.CORNELL_CAMERA, FRAMES)
        truth = renderer.read("direct") + renderer.read("albedo") * renderer.read("indirect") * color / np.pi
    finally:
        renderer.release()
    found = compared(context, settings, ("R3",), trace=traced(truth.astype(np.float32))).result
    rows = {row["method"]: row for row in found["methods"]["rows"]}
    assert rows["gtao"]["radius"] == pytest.approx(radius)
    assert rows["gtao"]["ambient"] == pytest.approx(color, rel=1e-3)
    assert rows["gtao"]["image"]["relative_rmse"] < 1e-3
    assert rows["constant_ambient"]["image"]["relative_rmse"] > 0.01
    assert rows["ssil_horizon"]["image"]["relative_rmse"] > 0.01
    assert rows["gtao"]["irradiance"].keys() == {"R3_visible", "R3_shown", "R3"}
    for name, row in (("direct_only", rows["direct_only"]), ("constant_ambient", rows["constant_ambient"]),
                      ("ssil", rows["ssil_horizon"])):
        assert row["image"] == pytest.approx(found["image"][name], rel=1e-3), name


@pytest.mark.skipif(not path_traced.has_mitsuba(), reason="needs Mitsuba: pip install 'ssil-viewer[reference]'")
def test_against_the_path_tracer(context):
    """SSIL is nearer to it than ambient light of any kind, and that nearer than none."""
    rows = {row["method"]: row["image"]["relative_rmse"]
            for row in compared(context, references=("R3",)).result["methods"]["rows"]}
    assert rows["ssil_horizon"] < rows["gtao"] <= rows["constant_ambient"] + 0.01
    assert rows["constant_ambient"] < rows["direct_only"]


def test_the_command(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(path_traced, "has_mitsuba", lambda: False)
    path_traced.working_variant.cache_clear()
    target, pictures = tmp_path / "out.json", tmp_path / "out.npz"
    assert cli.main(["compare", "builtin:cornell", "--size", "80x45", "--samples", "4", "--frames", "1", "--reference",
                     "R1,R3", "--blocks", "5", "--all", "--json", str(target), "--pictures", str(pictures)]) == 0
    path_traced.working_variant.cache_clear()
    said = capsys.readouterr()
    assert "R3 is left out" in said.err
    assert all(title in said.out for title in ("constant", "GTAO", "one level, off", "SSIL, voxel"))
    assert " ms of SSIL, horizon\n" in said.out and "ssil_" not in said.out
    assert "R1: relative RMSE of irradiance against the reference. Lower is better.\n" in said.out
    heads = [line for line in said.out.splitlines() if "samples" in line and " ms " in line and "┃" in line]
    assert [line.replace("┃", " ").split() for line in heads] == [["samples", "ms", "R1"]] * 2
    assert [row["method"] for row in json.loads(target.read_text())["methods"]["rows"]] == METHODS
    assert set(METHODS) <= set(np.load(pictures).files)


def test_columns_and_notes_tell_what_there_is():
    def row(method, samples, ms, image, **irradiance):
        return {"method": method, "title": f"<{method}>", "samples": samples, "ms": ms,
                "image": image and {"relative_rmse": image, "flip": None},
                "irradiance": {name: {"relative_rmse": value} for name, value in irradiance.items()}}

    rows = [row("a", 64, 2.0, 0.25, R2=0.5), row("b", 1, 9.0, 0.5, R2=None)]
    assert command._method_table(rows) == (("samples", "ms", "image", "R2"), [
        ("<a>", "64", "2", "0.250", "0.500"), ("<b>", "1", "9", "0.500", "-")])
    assert command._method_notes({"rows": rows, "equal_time": {"rows": rows}}) == [
        "R2: relative RMSE of irradiance against the reference; image: the same of the picture against R3. Lower is "
        "better.", "<b> takes 9 ms with a single sample already."]


@pytest.mark.parametrize("more", [("--bounces", "2"), ("--feedback",), ("--bounces", "0")])
def test_more_or_fewer_bounces_are_refused(capsys, more):
    assert cli.main(["compare", "builtin:cornell", "--size", "80x45", "--all", *more]) == 2
    error = capsys.readouterr().err
    assert "--all" in error and error.count("\n") == 1


def test_a_machine_that_does_other_work_is_told_of(context, monkeypatch):
    """The first measurement is that of the time to meet; all others take twice as long here."""
    from ssil_viewer.peers import compare_all as module
    from ssil_viewer.peers.methods import Method
    real, asked, first = module.measure_row, [], Method.own_ms

    def counted(*args):
        asked.append(args)
        return real(*args)

    monkeypatch.setattr(module, "measure_row", counted)
    monkeypatch.setattr(Method, "own_ms", lambda self, passes, quantile="median_ms":
                        first(self, passes, quantile) * 0 + (10.0 if len(asked) == 1 else 20.0))
    done = compared(context)
    assert any("took 10 ms at first and 20 ms later" in warning for warning in done.warnings)


def test_nothing_to_compare_with_is_said(context):
    """R3 was asked for alone and could not be made."""
    done = Comparison({})
    compare_all(scenes.cornell(), done, size=SIZE, settings=SETTINGS, camera=scenes.CORNELL_CAMERA, context=context)
    assert "methods" not in done.result and len(done.warnings) == 1
    with pytest.raises(UserError, match="one bounce"):
        compare_all(scenes.cornell(), done, size=SIZE, settings=replace(SETTINGS, bounces=2), context=context)


@pytest.mark.parametrize("size, level", [((1280, 720), 2), ((720, 1280), 2), ((320, 180), 1)])
def test_the_single_level_reaches_across_the_image_with_all_samples(size, level):
    settings = single_level(Settings(samples=64, start_level=level, levels=4, radius=10.0), size)
    assert (settings.levels, settings.samples, settings.start_level) == (1, 256, level)
    reach = settings.radius * size[1] / 720 * 2**level
    assert reach == pytest.approx(min(np.hypot(*size), 512 * size[1] / 720 * 2**level))
    assert single_level(Settings(samples=1024), size).samples == 1024


def test_each_method_is_one_bounce_of_the_given_settings():
    methods = {method.name: method for method in our_methods(replace(SETTINGS, thickness=0.3), SIZE)}
    assert [name for name in METHODS if name in methods] == ["direct_only", *METHODS[3:]]
    assert {method.settings.thickness for method in methods.values()} == {0.3}
    assert methods["ssil_horizon"].with_work(7).settings.samples == 7
    gtao = occlusion_method(SETTINGS, Occlusion(2.0)).with_work(5)
    assert (gtao.work, gtao.occlusion.radius, gtao.occlusion.samples) == (5, 2.0, 30)


@pytest.mark.parametrize("target, most, expected", [
    (30.0, 1000, 50),       # 5 + work / 2
    (5000.0, 1000, 1000),   # out of reach
    (1.0, 1000, 1),         # the fixed part alone takes longer
])
def test_the_work_for_a_time_is_found(target, most, expected):
    asked = []

    def measure(work):
        asked.append(work)
        return 5 + work / 2

    assert nearest_work(measure, target, 10, measure(10), most) == pytest.approx(expected, abs=3)
    assert len(asked) <= 6


def test_noise_does_not_end_the_search():
    """Less work that takes a little longer: almost all is a fixed part, and the least work is tried."""
    asked = []

    def measure(work):
        asked.append(work)
        return {16: 32.5}.get(work, 33.0 if work > 1 else 30.0)

    assert nearest_work(measure, 9.0, 16, 32.5, 1024) == 1
    assert nearest_work(lambda work: 5.0 + 1e-3 * work, 100.0, 16, 5.016, 1024) == 1024, "and the most"


def test_nothing_is_tried_where_times_are_equal_already():
    def measure(work):
        raise AssertionError("10 ms is near enough to 10.2")
    assert nearest_work(measure, 10.2, 20, 10.0, 100) == 20


def test_ambient_light_has_the_same_direct_light(context):
    """Shadows by rays, too."""
    found = []
    for passes in (FRAME, occlusion_frame(GroundTruthOcclusion())):
        settings = replace(SETTINGS, shadow_rays=True, shadow_resolution=128)
        renderer = Renderer(context, SIZE, occlusion_settings(settings), keep=("final",), passes=passes)
        renderer.set_scene(scenes.cornell())
        renderer.render(scenes.CORNELL_CAMERA)
        found.append(renderer.read("direct"))
        renderer.release()
    assert np.array_equal(*found)


def test_other_modes_can_be_left_out(context):
    methods = [method.name for method in our_methods(SETTINGS, SIZE, ("off", "horizon"))]
    assert methods == ["direct_only", "single_level_off", "single_level_horizon", "ssil_off", "ssil_horizon"]
    with pytest.raises(ValueError, match="horizon"):
        compare_all(scenes.cornell(), Comparison({}), size=SIZE, settings=SETTINGS, context=context,
                    visibilities=("off",))
