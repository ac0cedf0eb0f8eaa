"""`ssil-viewer compare --on-gpu`: R1 and R2 of the whole image, and the picture of the error."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from ssil_viewer import cli
from ssil_viewer.reference.compare import Effort, compare
from ssil_viewer.reference.gpu_pictures import ABSOLUTE, SIGNED, Scale
from ssil_viewer.reference.metrics import agreement, block_means
from ssil_viewer.reference.whole_image import legend
from ssil_viewer.settings import Settings
from tests import scenes

SIZE = 123, 77
SETTINGS = Settings(samples=32, start_level=1, levels=3, visibility="off")
EFFORT = Effort(("R1", "R2"), blocks=20, rays=300)


def compared(context, effort, settings=SETTINGS):
    return compare(scenes.cornell(), size=SIZE, settings=settings, camera=scenes.CORNELL_CAMERA, frames=2,
                   effort=effort, context=context)


def test_it_finds_what_the_processor_finds(context):
    """Of the same squares: R1 to what is printed, R2 to the noise of 300 rays in means of 8x8 pixels."""
    theirs, ours = (compared(context, replace(EFFORT, on_gpu=on)).result for on in (False, True))
    assert ours["blocks"] == theirs["blocks"] == 20
    for key in ("bias", "relative_rmse", "correlation"):
        assert ours["irradiance"]["R1"][key] == pytest.approx(theirs["irradiance"]["R1"][key], abs=2e-5)
        assert ours["irradiance"]["R2"][key] == pytest.approx(theirs["irradiance"]["R2"][key], abs=5e-3)
    assert theirs["differences"].keys() - ours["differences"].keys() == {"coarse_senders"}
    assert ours["differences"].keys() < theirs["differences"].keys()
    assert ours["seconds"].keys() == {"R1", "R2"}


def test_the_whole_image_is_in_the_result_and_in_the_pictures(context):
    done = compared(context, replace(EFFORT, on_gpu=True, rays=16, heat_map=Scale()))
    result, pictures = json.loads(json.dumps(done.result, allow_nan=False)), done.pictures
    assert pictures.keys() == {"irradiance", "irradiance_R1", "irradiance_R2"}
    assert {image.shape for image in pictures.values()} == {(77, 123, 3)}
    visible = pictures["irradiance_R1"].max(-1) > 0
    assert visible.mean() > 0.5
    for name in ("R1", "R2"):
        means = (block_means(pictures[key], visible, 8) for key in ("irradiance", f"irradiance_{name}"))
        assert result["whole_image"][name] == pytest.approx(agreement(*means), abs=1e-6)
    assert done.heat_map.shape[1] == 123 and done.heat_map.shape[0] > 77 + 40
    error = (pictures["irradiance"] - pictures["irradiance_R2"]).mean(-1) / pictures["irradiance_R2"][visible].mean()
    middle = np.array(SIGNED[2])
    close = visible & (np.abs(error) < 0.02)
    assert close.sum() > 100
    assert np.abs(done.heat_map[:77][close] / 255 - middle).max() < 0.06
    bright, dark = visible & (error > 0.1), visible & (error < -0.1)
    assert bright.sum() > 100 and dark.sum() > 20
    assert (done.heat_map[:77][bright][:, 0] > done.heat_map[:77][bright][:, 2]).all(), "too bright is red"
    assert (done.heat_map[:77][dark][:, 0] < done.heat_map[:77][dark][:, 2]).all(), "too dark is blue"


def test_r2_needs_no_embree(context, monkeypatch):
    for name in [n for n in sys.modules if n.startswith(("embreex", "ssil_viewer.reference.occluders",
                                                         "ssil_viewer.reference.visible_pixels"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "embreex", None)
    done = compared(context, replace(EFFORT, on_gpu=True, rays=4, references=("R2",)))
    assert done.result["irradiance"].keys() == {"R2"}
    assert not done.warnings


@pytest.mark.parametrize("scale", [Scale(0.25, signed=True), Scale(2.0, signed=False)])
def test_the_legend_has_the_scales_colours(scale):
    made = legend(300, scale, "a line of words that is too long for so narrow a picture and so goes on below")
    bar = made[15].astype(float) / 255
    stops = np.array(SIGNED if scale.signed else ABSOLUTE)
    for column, stop in zip((30, 90, 150, 209, 269), stops):
        assert np.abs(bar[column] - stop).max() < 0.03
    assert len(legend(300, scale, "short")) < len(made)
    assert legend(3, scale, "word").shape[1] == 3
    together = "0.25 W m^-2".replace(" ", "\N{NO-BREAK SPACE}")
    assert len(legend(60, scale, together)) < len(legend(60, scale, "0.25 W m^-2")), "a number keeps its unit"


def test_the_command_writes_the_picture(tmp_path, capsys):
    target = tmp_path / "error.png"
    assert cli.main(["compare", "builtin:cornell", "--size", "64x36", "--samples", "4", "--levels", "2",
                     "--frames", "1", "--blocks", "3", "--reference", "R1", "--heat-map", str(target),
                     "--heat-map-range", "0.3", "--json", str(tmp_path / "error.json")]) == 0
    out = capsys.readouterr().out
    assert "whole image" in out
    assert Image.open(target).size[0] == 64
    assert json.loads((tmp_path / "error.json").read_text())["whole_image"].keys() == {"R1"}


@pytest.mark.parametrize(("words", "complaint"), [
    (["--heat-map", "x.jpg"], "x.jpg"), (["--heat-map", "x.png", "--reference", "R3"], "--reference"),
    (["--heat-map", "x.png", "--heat-map-range", "0"], "--heat-map-range"),
    (["--heat-map", "nowhere/x.png"], "nowhere"), (["--heat-map-colors", "pink"], "pink")])
def test_mistakes_are_one_line(tmp_path, monkeypatch, capsys, words, complaint):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["compare", "builtin:cornell", *words]) == 2
    error = capsys.readouterr().err
    assert complaint in error and len(error.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
