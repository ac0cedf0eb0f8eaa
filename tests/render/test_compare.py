"""`ssil-viewer compare`, with the path tracer's part played by something else."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer import cli
from ssil_viewer.reference import metrics, path_traced
from ssil_viewer.reference.compare import BLOCK, Blocks, Effort, compare, require_some
from ssil_viewer.reference.mitsuba_export import camera_description, describe
from ssil_viewer.reference.mitsuba_job import ImageTask
from ssil_viewer.reference.path_traced import ReferenceFailure
from ssil_viewer.scene.model import Material
from ssil_viewer.settings import Settings
from tests import scenes
from tests.render import test_shown
from tests.render.test_closed_forms import GLOWING

SIZE = 160, 90
SETTINGS = Settings(samples=32, start_level=1, levels=3, visibility="off")
EFFORT = Effort(("R1", "R2", "R3"), blocks=12, rays=32, path_rays=36, spp=2, seconds=60.0)


def test_metrics_by_hand():
    reference, ours = np.array([[1.0], [3.0]]), np.array([[2.0], [4.0]])
    found = metrics.agreement(ours, reference)
    assert found["bias"] == pytest.approx(0.5)
    assert found["relative_rmse"] == pytest.approx(0.5)
    assert found["correlation"] == pytest.approx(1.0)
    assert metrics.agreement(-ours, reference)["correlation"] == pytest.approx(-1.0)
    assert metrics.agreement(ours, np.zeros_like(ours)) == {"bias": None, "relative_rmse": None, "correlation": 0.0}
    assert metrics.noise_of_halves(np.array([1.0, 1.0]), np.array([3.0, 3.0])) == pytest.approx(0.5)


def test_blocks_leave_out_background_and_the_cut_ones():
    image = np.arange(5 * 7, dtype=float).reshape(5, 7, 1)
    visible = np.ones((5, 7), bool)
    visible[0, 0] = False
    found = metrics.block_means(image, visible, 2)
    assert found.shape == (5, 1)
    assert found[0, 0] == image[0:2, 2:4].mean()


def test_half_of_the_noise_is_found():
    """The noise of a mean is that of one of its halves over the square root of two."""
    first, second = 5 + np.random.default_rng(1).normal(0, 0.1, (2, 100_000))
    assert metrics.noise_of_halves(first, second) == pytest.approx(0.1 / np.sqrt(2) / 5, rel=0.02)


def fake_trace(factor):
    """A path tracer whose light is given; what it is asked for is kept."""
    asked = {}

    def trace(description, tasks, progress):
        found = {}
        for task in tasks:
            asked[task.name] = task
            progress(task.name, 1.0)
            if task.name == "irradiance":
                light = np.full((2, len(task.position), 3), factor)
                found[task.name] = {"all": light, "diffuse": light, "visible": 0.6 * light, "shown": 0.5 * light,
                                     "visible_mirrored": 0.6 * light, "rays": np.array(task.rays)}
            else:
                image = np.full((task.camera["height"], task.camera["width"], 3), factor, np.float32)
                found[task.name] = {"image": image, "first": image, "second": image, "spp": np.array(task.spp)}
        return found
    return trace, asked


def test_the_promised_structure(context):
    trace, asked = fake_trace(2.0)
    done = compare(scenes.cornell(), size=SIZE, settings=SETTINGS, camera=scenes.CORNELL_CAMERA, frames=2,
                   effort=EFFORT, context=context, trace=trace)
    result = json.loads(json.dumps(done.result, allow_nan=False))
    assert {"scene", "size", "settings", "block", "irradiance", "image", "seconds"} <= result.keys()
    assert (result["size"], result["block"], result["blocks"]) == (list(SIZE), BLOCK, 12)
    assert list(result["irradiance"]) == ["R1", "R2", "R3_shown", "R3_visible", "R3"]
    for found in result["irradiance"].values():
        assert found.keys() == {"bias", "relative_rmse", "correlation"}
    assert result["image"].keys() == {"ssil", "direct_only", "constant_ambient"}
    for found in result["image"].values():
        assert found.keys() == {"relative_rmse", "flip"} if metrics.has_flip() else {"relative_rmse"}
    assert result["seconds"].keys() == {"R1", "R2", "R3"}
    assert Settings(**result["settings"]) == SETTINGS
    assert asked["image"].bounces == 1
    assert result["differences"]["missing_layers"] == pytest.approx(0.4), "visible is 0.6 of all in the fake"
    assert result["differences"]["between_pixels"] == pytest.approx(0.1)
    assert asked["irradiance"].shown.normal.shape == (SIZE[1], SIZE[0], 3)


def test_r1_and_r2_say_what_they_should(context):
    """Ours without visibility follows R1, and what R2 takes off is there to be seen."""
    done = compare(scenes.cornell(), size=SIZE, settings=replace(SETTINGS, samples=256, radius=96.0),
                   camera=scenes.CORNELL_CAMERA, frames=4, context=context,
                   effort=replace(EFFORT, references=("R1", "R2"), blocks=40))
    light = done.result["irradiance"]
    assert light.keys() == {"R1", "R2"}
    assert light["R1"]["relative_rmse"] < 0.12
    assert light["R1"]["correlation"] > 0.95
    assert light["R2"]["bias"] > light["R1"]["bias"] + 0.03, "light through the blocks"
    assert done.result["image"] == {}
    shares = done.result["differences"]
    assert shares["noise"] < shares["method_without_visibility"] < shares["method_with_visibility"]


def test_the_image_is_compared_with_its_own_bounces(context):
    for settings, bounces in ((replace(SETTINGS, bounces=3), 3), (replace(SETTINGS, bounces=0), 0),
                              (replace(SETTINGS, feedback=True), None)):
        trace, asked = fake_trace(1.0)
        done = compare(scenes.cornell(), size=SIZE, settings=settings, camera=scenes.CORNELL_CAMERA, frames=1,
                       effort=replace(EFFORT, references=("R3",)), context=context, trace=trace)
        assert asked["image"].bounces == bounces
        assert done.result["image_bounces"] == bounces
        assert done.result["irradiance"].keys() == {"R3", "R3_visible", "R3_shown"}


def test_the_best_constant_is_found(context):
    """Where the truth is direct light and a constant, constant ambient has no error and the others have."""
    from ssil_viewer import headless

    settings = replace(SETTINGS, temporal=False)
    images = headless.render(scenes.cornell(), size=SIZE, settings=settings, camera=scenes.CORNELL_CAMERA,
                             context=context)
    truth = (images["direct"] + images["albedo"] * (0.2, 0.1, 0.3)).astype(np.float32)

    def trace(description, tasks, progress):
        found = {"image": truth, "first": truth, "second": truth, "spp": np.array(2)}
        light = np.ones((2, EFFORT.blocks * BLOCK**2, 3))
        return {"image": found, "irradiance": dict.fromkeys(
            ("all", "diffuse", "visible", "visible_mirrored", "shown"), light) | {"rays": np.array(36)}}

    image = compare(scenes.cornell(), size=SIZE, settings=settings, camera=scenes.CORNELL_CAMERA, frames=1,
                    effort=replace(EFFORT, references=("R3",)), context=context, trace=trace).result["image"]
    assert image["constant_ambient"]["relative_rmse"] < 1e-3
    assert image["ssil"]["relative_rmse"] > 0.01
    assert image["direct_only"]["relative_rmse"] > 0.01


def test_without_mitsuba_the_others_are_made(context, monkeypatch):
    monkeypatch.setattr(path_traced, "has_mitsuba", lambda: False)
    path_traced.working_variant.cache_clear()
    done = compare(scenes.cornell(), size=SIZE, settings=SETTINGS, camera=scenes.CORNELL_CAMERA, frames=1,
                   effort=EFFORT, context=context)
    path_traced.working_variant.cache_clear()
    assert done.result["irradiance"].keys() == {"R1", "R2"}
    assert done.result["image"] == {}
    assert any("R3 is left out" in line and "[reference]" in line for line in done.warnings)


def test_without_embree_the_others_are_made(context, monkeypatch):
    for name in [n for n in sys.modules if n.startswith(("embreex", "ssil_viewer.reference.occluders",
                                                         "ssil_viewer.reference.visible_pixels"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "embreex", None)
    done = compare(scenes.cornell(), size=SIZE, settings=SETTINGS, camera=scenes.CORNELL_CAMERA, frames=1,
                   effort=replace(EFFORT, references=("R1", "R2")), context=context)
    assert done.result["irradiance"].keys() == {"R1"}
    assert any("R2 is left out" in line and "embreex" in line for line in done.warnings)


@pytest.mark.parametrize("words, missing, said", [
    (("R3",), "mitsuba", "R3 cannot be made: Mitsuba is not installed: "),
    (("R2",), "embreex", "R2 cannot be made: embreex is not installed: "),
    (("R2,R3",), "embreex mitsuba", "; R3 cannot be made: Mitsuba is not installed: ")])
def test_where_nothing_can_be_made_the_command_says_so_at_once(capsys, monkeypatch, words, missing, said):
    """It rendered, and ended with a heading and exit status 0."""
    if "mitsuba" in missing:
        monkeypatch.setattr(path_traced, "has_mitsuba", lambda: False)
    if "embreex" in missing:
        monkeypatch.delitem(sys.modules, "ssil_viewer.reference.occluders", raising=False)
        monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    path_traced.working_variant.cache_clear()
    monkeypatch.setattr("ssil_viewer.scene.load_scene", lambda *_, **__: pytest.fail("it loads the scene"))
    assert cli.main(["compare", "builtin:cornell", "--size", "160x90", "--reference", *words]) == 2
    path_traced.working_variant.cache_clear()
    shown, error = capsys.readouterr()
    assert said in error and "[reference]" in error and error.count("\n") == 1 and not shown


def test_what_no_package_is_needed_for_is_not_refused(monkeypatch):
    monkeypatch.setattr("ssil_viewer.reference.compare.working_variant",
                        lambda: pytest.fail("it tries Mitsuba, which takes seconds"))
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    require_some(Effort(references=("R1", "R3")))
    require_some(Effort(references=("R2", "R3"), on_gpu=True))


def test_a_process_that_dies_is_told_of(monkeypatch):
    """As with an LLVM that does not fit: the process aborts without a word, or after one."""
    dying = [sys.executable, "-c", "import os, sys; sys.stderr.write('LLVM ERROR: Cannot select'); sys.stderr.flush(); "
             "os.abort()"]
    monkeypatch.setattr(path_traced, "_command", lambda variant: dying)
    monkeypatch.setattr(path_traced, "has_mitsuba", lambda: True)
    path_traced.working_variant.cache_clear()
    with pytest.raises(ReferenceFailure, match="does not work here.*LLVM ERROR: Cannot select.*mitsuba"):
        path_traced.working_variant()
    path_traced.working_variant.cache_clear()
    task = ImageTask("image", camera_description(scenes.CORNELL_CAMERA, SIZE, scenes.cornell()), 0, 2, 1, 1.0)
    with pytest.raises(ReferenceFailure, match="ended before it was done.*LLVM ERROR: Cannot select"):
        path_traced.path_trace(describe(scenes.cornell()), [task], variant="llvm_ad_rgb")


def test_an_image_without_surfaces(context):
    empty = scenes.scene((scenes.rectangle((-1, -1, 5), (2, 0, 0), (0, 2, 0)),), (Material(),))
    trace, _ = fake_trace(1.0)
    done = compare(empty, size=SIZE, settings=SETTINGS, camera=scenes.CORNELL_CAMERA, frames=1, effort=EFFORT,
                   context=context, trace=trace)
    assert done.result["irradiance"] == {} == done.result["image"]
    assert sum("without background" in line for line in done.warnings) == 2


def test_the_command(capsys, tmp_path):
    target, pictures = tmp_path / "out.json", tmp_path / "out.npz"
    assert cli.main(["compare", "builtin:cornell", "--size", "160x90", "--samples", "16", "--frames", "1",
                     "--reference", "r1", "--blocks", "5", "--json", str(target), "--pictures", str(pictures)]) == 0
    assert list(json.loads(target.read_text())["irradiance"]) == ["R1"]
    assert "relative RMSE" in capsys.readouterr().out


@pytest.mark.parametrize("words, said", [
    (("--reference", "R4"), "R4"), (("--reference", ","), "no reference is named"), (("--json", "x.txt"), "format"),
    (("--blocks", "0"), "--blocks"), (("--spp", "many"), "--spp")])
def test_bad_flags(capsys, words, said):
    assert cli.main(["compare", "builtin:cornell", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_the_bounce_series_counts_as_the_path_tracer(context):
    """With a path tracer that shows our own image after four bounces, the error falls to nothing there."""
    from ssil_viewer import headless
    from ssil_viewer.reference.bounce_series import bounce_series

    settings, asked = replace(SETTINGS, temporal=False), {}
    truth = headless.render(scenes.cornell(), size=SIZE, settings=replace(settings, bounces=4),
                            camera=scenes.CORNELL_CAMERA, context=context)["final"]

    def trace(description, tasks, progress):
        asked.update({task.name: task.bounces for task in tasks})
        return {task.name: {"image": truth} for task in tasks}

    series, warnings = bounce_series(scenes.cornell(), size=SIZE, settings=settings, camera=scenes.CORNELL_CAMERA,
                                     frames=1, spp=2, seconds=1.0, trace=trace)
    assert not warnings
    assert asked == {"bounces0": 0, "bounces1": 1, "bounces2": 2, "bounces3": 3, "bounces4": 4, "all": None}
    errors = [step["relative_rmse"] for step in series]
    assert all(later < earlier for earlier, later in zip(errors, errors[1:]))
    assert errors[-1] < 1e-3 < errors[0]


def test_an_image_is_shown_as_the_renderer_shows_its_own(make_renderer):
    """`displayed` of the final image is the display, but for the rounding of half floats."""
    for tone_map in ("neutral", "aces", "reinhard", "linear"):
        renderer = make_renderer(scenes.cornell(), (45, 31), samples=8, tone_map=tone_map, exposure=0.7,
                                 antialias=False)
        renderer.render(scenes.CORNELL_CAMERA)
        from ssil_viewer.headless import read_display
        difference = renderer.displayed(renderer.read("final")).astype(int) - read_display(renderer)
        assert np.abs(difference).max() <= 1


def test_each_reference_is_compared_with_the_light_that_it_knows():
    """R1, R2 and R3_shown with what the image shows, R3_visible with what the camera sees, R3 with all."""
    at = np.arange(8)[None, :, None] + np.zeros((1, 8, 8), int)
    blocks = Blocks(at, at.swapaxes(1, 2), {name: np.ones((1, 3)) for name in ("R1", "R2", "R3_shown", "R3_visible",
                                                                               "R3", "R3_diffuse")})
    everything, shown, visible = (np.full((8, 8, 3), value) for value in (4.0, 2.0, 3.0))

    def biases(*images):
        return {name: found["bias"] for name, found in blocks.agreement(*images).items()}

    assert biases(everything, shown, visible) == {"R1": 1, "R2": 1, "R3_shown": 1, "R3_visible": 2, "R3": 3}
    assert biases(everything, shown) == {"R1": 1, "R2": 1, "R3_shown": 1, "R3": 3}
    assert biases(everything) == dict.fromkeys(("R1", "R2", "R3_shown", "R3_visible", "R3"), 3)


def test_light_between_pixels_is_that_of_visible_senders(context):
    """A ledge that no pixel has and a lamp behind the camera: each reference with more of ours than the one before."""
    lamp = scenes.rectangle((0.5, 0.2, 5), (-1, 0, 0), (0, 1, 0), 1)
    scene = scenes.scene((test_shown.WALL, test_shown.LEDGE, lamp), (Material(specular=0.0), GLOWING))
    trace, _ = fake_trace(1.0)
    settings = replace(SETTINGS, start_level=1, unseen_samples=8, temporal_frames=64)
    done = compare(scene, size=test_shown.SIZE, settings=settings, camera=test_shown.CAMERA, frames=4, context=context,
                   effort=replace(EFFORT, references=("R3",), blocks=40), trace=trace)
    # Of 1 in R3, 0.6 is visible and 0.5 shown in the fake
    ours = {name: (done.result["irradiance"][name]["bias"] + 1) * of
            for name, of in (("R3_shown", 0.5), ("R3_visible", 0.6), ("R3", 1.0))}
    assert ours["R3_shown"] == pytest.approx(0, abs=1e-6)
    assert 0.01 < ours["R3_visible"] < 0.9 * ours["R3"]
    only_view = compare(scene, size=test_shown.SIZE, settings=replace(settings, unseen_from="view"), frames=4,
                        camera=test_shown.CAMERA, context=context, trace=trace,
                        effort=replace(EFFORT, references=("R3",), blocks=40))
    assert only_view.result["irradiance"]["R3"]["bias"] + 1 == pytest.approx(ours["R3_visible"], rel=1e-6)
