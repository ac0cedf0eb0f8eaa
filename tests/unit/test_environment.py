"""Environment files and what is integrated from them, with numpy alone."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer import output
from ssil_viewer.errors import UserError
from ssil_viewer.scene import environment as module
from ssil_viewer.scene.environment import (
    Environment,
    area_averaged,
    direction_of,
    irradiance_map,
    load_environment,
    specular_levels,
)


def write_hdr(path, pixels):
    """Radiance RGBE without run lengths."""
    height, width = pixels.shape[:2]
    exponent = np.ceil(np.log2(np.maximum(pixels.max(-1), 1e-30)))
    rgbe = np.zeros((height, width, 4), np.uint8)
    rgbe[..., :3] = np.clip(pixels / 2.0 ** exponent[..., None] * 256.0, 0, 255)
    rgbe[..., 3] = exponent + 128
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode() + rgbe.tobytes())


def sample(width=64, height=32):
    rng = np.random.default_rng(5)
    return rng.uniform(0.1, 4.0, (height, width, 3)).astype(np.float32)


def test_hdr_and_exr_are_read_as_they_are(tmp_path):
    pixels = sample()
    output.write_exr(tmp_path / "map.exr", {"": pixels})
    loaded = load_environment(tmp_path / "map.exr")
    assert np.array_equal(loaded.radiance, pixels) and not loaded.warnings
    write_hdr(tmp_path / "map.hdr", pixels)
    assert np.allclose(load_environment(tmp_path / "map.hdr").radiance, pixels, atol=4.0 / 128)


def test_values_that_light_cannot_have_are_replaced_and_counted(tmp_path):
    pixels = sample()
    pixels[0, 0, 1], pixels[1, :3, 0], pixels[2, 0, 2], pixels[3, 4] = np.nan, -1.0, np.inf, (-np.inf, 1.0, 1.0)
    output.write_exr(tmp_path / "map.exr", {"": pixels})
    loaded = load_environment(tmp_path / "map.exr")
    assert np.isfinite(loaded.radiance).all() and loaded.radiance.min() == 0.0
    assert loaded.radiance[2, 0, 2] == pytest.approx(pixels[np.isfinite(pixels)].max())
    untouched = np.isfinite(pixels).all(-1) & (pixels >= 0).all(-1)
    assert np.array_equal(loaded.radiance[untouched], pixels[untouched]), "nothing may spread"
    assert any("3 pixels that are infinite" in w for w in loaded.warnings)
    assert any("3 pixels below zero" in w for w in loaded.warnings)


@pytest.mark.parametrize("name, content", [
    ("map.hdr", b""), ("map.exr", b""), ("map.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\nabc"),
    ("map.exr", b"\x76\x2f\x31\x01 nothing"), ("map.png", b"x"), ("map", b"x")])
def test_broken_files_are_one_line(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError) as error:
        load_environment(tmp_path / name)
    assert str(tmp_path / name) in str(error.value) and "\n" not in str(error.value)


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(UserError, match="does not exist"):
        load_environment(tmp_path / "none.hdr")
    (tmp_path / "folder.hdr").mkdir()
    with pytest.raises(UserError, match="is no file"):
        load_environment(tmp_path / "folder.hdr")


def test_too_large_maps_are_refused_with_advice(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MAX_WIDTH", 32)
    output.write_exr(tmp_path / "map.exr", {"": sample()})
    with pytest.raises(UserError, match="64x32 pixels.*scale it to at most 32x"):
        load_environment(tmp_path / "map.exr")


def test_directions():
    assert np.allclose(direction_of(np.array(0.5), np.array(0.5)), (0, 0, 1), atol=1e-12)
    assert np.allclose(direction_of(np.array(0.25), np.array(0.5)), (1, 0, 0), atol=1e-12)
    assert np.allclose(direction_of(np.array(0.3), np.array(0.0)), (0, 1, 0), atol=1e-12)


@pytest.mark.parametrize("size", [(64, 32), (37, 19), (1, 1), (300, 2)])
def test_averages_keep_the_light(size):
    """Every smaller map has the same integral over the sphere, whatever its size."""
    def integral(pixels):
        edges = np.pi * np.arange(pixels.shape[0] + 1) / pixels.shape[0]
        return (pixels.mean(1) * np.diff(-np.cos(edges))[:, None]).sum(0)
    pixels = sample(*size)
    assert np.allclose(integral(area_averaged(pixels, 16, 8)), integral(pixels), rtol=1e-4)


def test_even_light():
    """E = pi L for all normals, and every blurred level is the light itself."""
    even = np.full((50, 90, 3), 2.0, np.float32)
    assert np.allclose(irradiance_map(even), 2.0 * np.pi, rtol=2e-3)
    for level in specular_levels(even):
        assert np.allclose(level, 2.0, rtol=1e-5)


def test_blurred_levels_hold_the_lobe():
    """Against the sum over all pixels with the lobe written out, D(h) cos, at two directions; 3 % of the largest, which
    is what half a pixel of the level makes."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[20:24, 30:36] = 5.0
    rows, columns = (np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128
    d = direction_of(columns[None], rows[:, None])
    solid = np.sin(np.pi * rows)[:, None]
    for level in (2, 3, 4):
        alpha2 = (level / 5) ** 4
        found = specular_levels(pixels)[level]
        height, width = found.shape[:2]
        for row, column in ((height // 3, width // 4), (height // 2, width // 3)):
            cosine = d @ direction_of((column + 0.5) / width, (row + 0.5) / height)
            lobe = np.maximum(cosine, 0) / ((0.5 + 0.5 * cosine) * (alpha2 - 1) + 1) ** 2 * solid
            expected = (lobe * pixels[..., 0]).sum() / lobe.sum()
            assert found[row, column, 0] == pytest.approx(expected, abs=0.03 * float(found.max()))


def test_a_map_has_three_channels():
    with pytest.raises(ValueError):
        Environment("x", np.zeros((4, 4), np.float32))


@pytest.mark.parametrize("name, irradiance, zenith_over_horizon", [
    ("sky", 1.9, 1 - np.exp(-0.32)), ("overcast", 3.0, 3.0)])
def test_built_in_skies(name, irradiance, zenith_over_horizon):
    """The irradiance on level ground, the standard distributions' ends, gray ground below, the same all around."""
    sky = load_environment(f"builtin:{name}")
    luminance = sky.radiance @ np.float32((0.2126, 0.7152, 0.0722))
    rows = luminance[:, 0]
    middle = len(rows) // 2
    assert sky.irradiance[0, 0] @ (0.2126, 0.7152, 0.0722) == pytest.approx(irradiance, rel=1e-3)
    assert rows[0] / rows[middle - 1] == pytest.approx(zenith_over_horizon, rel=0.02)
    assert np.allclose(sky.radiance[middle:], 0.15 * (irradiance + (9.0 if name == "sky" else 0.0)) / np.pi, rtol=1e-5)
    assert (sky.radiance == sky.radiance[:, :1]).all() and not sky.warnings
    steps = np.diff(rows[:middle])
    assert (steps >= 0).all() or (steps <= 0).all()


@pytest.mark.parametrize("name, said", [
    ("sky", "the environment cannot be a file without ending, sky, did you mean builtin:sky?"),
    ("", "the environment cannot be a file without ending, ., "
         "give an equirectangular .hdr or .exr, or builtin:sky or builtin:overcast")])
def test_names_that_are_no_files(name, said):
    with pytest.raises(UserError) as caught:
        load_environment(name)
    assert str(caught.value) == said


def test_a_built_in_sky_that_there_is_not():
    with pytest.raises(UserError) as caught:
        load_environment("builtin:overcats")
    assert str(caught.value) == "there is no such built-in sky, builtin:overcats, did you mean builtin:overcast?"
