"""The examples run, and what the embedding example gets is what the renderer makes of the same scene."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ssil_viewer
from ssil_viewer.scene.model import Camera, Light, Material
from tests import scenes

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SIZE = (80, 45)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def example(name: str):
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_headless(capsys):
    images = example("headless").main(size=SIZE, frames=2)
    expected = images["direct"] + images["albedo"] * images["indirect"] / np.pi + images["glossy"]
    # Half floats in the targets, 8-bit albedo in both
    assert np.allclose(images["final"], expected, atol=2e-3 * expected.max())
    with np.load("headless.npz") as saved:
        assert np.array_equal(saved["indirect"], images["indirect"])
    with Image.open("headless.png") as picture:
        assert picture.size == SIZE
    assert "indirect" in capsys.readouterr().out


@pytest.mark.parametrize("temporal", [True, False])
def test_embed_agrees_with_the_renderer(temporal):
    embed = example("embed")
    settings = ssil_viewer.Settings(start_level=0, levels=3, samples=32, temporal=temporal)
    ours = embed.main(size=SIZE, frames=3, settings=settings)
    materials = tuple(Material(base_color=(*albedo, 1.0), specular=0.0) for *_, albedo in embed.ROOM)
    quads = [scenes.rectangle(corner, u, v, at) for at, (corner, u, v, _) in enumerate(embed.ROOM)]
    lamp = Light("point", intensity=embed.POWER, position=embed.LAMP, cast_shadow=False)
    x, y, z = embed.EYE
    camera = Camera(eye=embed.EYE, target=(x, y, z - 1), vertical_fov=embed.FOV, near=embed.NEAR)
    theirs = ssil_viewer.render(scenes.scene(quads, materials, (lamp,)), size=SIZE, settings=settings, camera=camera,
                                frames=3)["indirect"]
    assert theirs.max() > 0.1
    # The same passes: only the roundings of the two G-buffers differ (8-bit against half-float albedo, 24-bit depth)
    difference = np.abs(ours - theirs)
    assert np.median(difference) < 0.005 * theirs.mean()
    assert np.quantile(difference, 0.99) < 0.05 * theirs.mean()
    with Image.open("embed.png") as picture:
        assert np.asarray(picture).max() > 100
