"""Lights, reflection and display curves on the GPU against their formulas."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.gpu.light_table import LightTable
from ssil_viewer.scene.model import Light
from tests.gpu_function import evaluate

COLOR = ("lib/color.glsl",)


def khr_irradiance(light: Light, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """KHR_lights_punctual: (irradiance at normal incidence (N, 3), direction to the light (N, 3))."""
    power = np.asarray(light.color) * light.intensity
    if light.kind == "directional":
        return np.tile(power, (len(points), 1)), np.tile(-np.asarray(light.direction), (len(points), 1))
    to = np.asarray(light.position) - points
    r = np.linalg.norm(to, axis=1)
    wi = to / r[:, None]
    falloff = 1 / r**2
    if np.isfinite(light.range):
        falloff *= np.clip(1 - (r / light.range) ** 4, 0, 1)
    if light.kind == "spot":
        scale = 1 / max(1e-3, np.cos(light.inner_cone) - np.cos(light.outer_cone))
        angular = np.clip(((-wi) @ np.asarray(light.direction) - np.cos(light.outer_cone)) * scale, 0, 1)
        falloff *= angular**2
    return power * falloff[:, None], wi


LIGHTS = (
    Light("point", color=(1, 0.5, 0.25), intensity=7.0, position=(0.3, 1, -2)),
    Light("point", intensity=5.0, position=(0, 0, 0), range=2.5),
    Light("spot", intensity=9.0, position=(1, 2, 3), direction=(0, -0.6, -0.8), inner_cone=0.2, outer_cone=0.5),
    Light("spot", intensity=9.0, position=(1, 2, 3), direction=(0, -1, 0), inner_cone=0.0, outer_cone=np.pi / 2),
    Light("directional", color=(0.2, 1, 1), intensity=3.0, direction=(0.6, 0, -0.8)),
)


@pytest.mark.parametrize("index", range(len(LIGHTS)))
def test_light_irradiance(context, index):
    table = LightTable(context)
    table.update(LIGHTS, np.zeros(3), np.array([[-4.0] * 3, [4.0] * 3]), 128, 4096)
    points = np.random.default_rng(index).uniform(-4, 4, (2000, 3)).astype(np.float32)
    body = f"vec3 wi; vec3 e = light_irradiance(fetch_light(lights, {index}), a.xyz, wi); "
    options = {"declarations": "uniform sampler2D lights;", "textures": {"lights": table.table}}
    ours = evaluate(context, ("lib/lights.glsl",), body + "result.rgb = e;", points, **options)[:, :3]
    towards = evaluate(context, ("lib/lights.glsl",), body + "result.rgb = wi;", points, **options)[:, :3]
    expected, wi = khr_irradiance(LIGHTS[index], points.astype(np.float64))
    assert np.allclose(ours, expected, rtol=2e-4, atol=1e-5 * expected.max())
    assert np.allclose(towards, wi, atol=1e-5)
    table.release()


def test_light_at_its_own_position_is_finite(context):
    table = LightTable(context)
    table.update(LIGHTS, np.zeros(3), np.array([[-4.0] * 3, [4.0] * 3]), 128, 4096)
    point = np.array([LIGHTS[0].position], np.float32)
    body = "vec3 wi; result.rgb = light_irradiance(fetch_light(lights, 0), a.xyz, wi);"
    e = evaluate(context, ("lib/lights.glsl",), body, point, declarations="uniform sampler2D lights;",
                 textures={"lights": table.table})
    assert np.isfinite(e).all()
    table.release()


# -- GGX ---------------------------------------------------------------------------------------------------------

def directions(count: int, seed: int) -> np.ndarray:
    """Uniform on the hemisphere about +Z, not closer than 2 degrees to the horizon."""
    rng = np.random.default_rng(seed)
    z, turn = rng.uniform(0.035, 1, count), rng.uniform(0, 2 * np.pi, count)
    return np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], 1)


def ggx(context, wo, wi, roughness: float, f0=(1.0, 1.0, 1.0)) -> np.ndarray:
    body = (f"result.rgb = brdf_ggx(vec3({f0[0]}, {f0[1]}, {f0[2]}), {roughness:.6f}, vec3(0.0, 0.0, 1.0), a.xyz,"
            " b.xyz);")
    return evaluate(context, ("lib/brdf.glsl",), body, wo, wi)[:, :3].astype(np.float64)


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_ggx_is_reciprocal(context, roughness):
    wo, wi = directions(1000, 1), directions(1000, 2)
    forth, back = (ggx(context, *pair, roughness, (0.04, 0.5, 0.9)) for pair in ((wo, wi), (wi, wo)))
    assert (forth >= 0).all()
    assert np.allclose(forth, back, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.3])
def test_ggx_white_furnace(context, roughness, cosine):
    """A mirror of white metal under a white sky reflects no more than it gets, and nearly all of it when smooth.

    Half vectors are drawn from the distribution itself: pdf of wi = D cos_h / (4 wo.h).
    """
    rng = np.random.default_rng(8)
    alpha = roughness**2
    u, turn = rng.random(20000), rng.uniform(0, 2 * np.pi, 20000)
    cos_h = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))
    sin_h = np.sqrt(1 - cos_h**2)
    h = np.stack([sin_h * np.cos(turn), sin_h * np.sin(turn), cos_h], 1)
    wo = np.tile((np.sqrt(1 - cosine**2), 0, cosine), (len(h), 1))
    o_dot_h = (wo * h).sum(1)
    wi = 2 * o_dot_h[:, None] * h - wo
    density = alpha**2 / (np.pi * (cos_h**2 * (alpha**2 - 1) + 1) ** 2)
    pdf = density * cos_h / (4 * np.maximum(o_dot_h, 1e-9))
    up = (wi[:, 2] > 0) & (o_dot_h > 0)
    weight = np.where(up, ggx(context, wo, wi, roughness)[:, 0] * wi[:, 2] / pdf, 0)
    # 20,000 samples of weights between 0 and 1: a standard error below 0.004
    assert weight.mean() < 1.01
    assert weight.mean() > (0.9 if roughness <= 0.3 else 0.25), "one bounce alone loses up to two thirds at roughness 1"


# -- display -----------------------------------------------------------------------------------------------------

def grid() -> np.ndarray:
    rng = np.random.default_rng(9)
    return np.concatenate([10.0 ** rng.uniform(-4, 3, (2000, 3)), np.linspace(0, 4, 500)[:, None].repeat(3, 1)])


def aces(c):
    return np.clip(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0, 1)


def neutral(c):
    """Khronos PBR Neutral as published."""
    low = c.min(-1, keepdims=True)
    c = c - np.where(low < 0.08, low - 6.25 * low**2, 0.04)
    peak = c.max(-1, keepdims=True)
    start = 0.8 - 0.04
    d = 1 - start
    new = 1 - d * d / (np.maximum(peak, start) + d - start)
    g = 1 - 1 / (0.15 * (peak - new) + 1)
    return np.where(peak < start, c, c * (new / np.maximum(peak, 1e-9)) * (1 - g) + new * g)


@pytest.mark.parametrize("name, formula", [("aces", aces), ("neutral", neutral), ("reinhard", lambda c: c / (1 + c))])
def test_tone_maps(context, name, formula):
    values = grid().astype(np.float32)
    ours = evaluate(context, COLOR, f"result.rgb = tone_map_{name}(a.rgb);", values)[:, :3]
    assert np.allclose(ours, formula(values.astype(np.float64)), atol=2e-5)
    assert ours.min() >= -1e-5 and ours.max() <= 1.0001
    greys = ours[-500:, 0]
    assert (np.diff(greys) >= -1e-6).all(), "brighter stays brighter"


def test_srgb(context):
    """To a two hundredth of a code value of 255."""
    values = np.linspace(-0.2, 1.5, 1000, dtype=np.float32)[:, None].repeat(3, 1)
    ours = evaluate(context, COLOR, "result.rgb = srgb_from_linear(a.rgb);", values)[:, 0]
    c = np.clip(values[:, 0].astype(np.float64), 0, 1)
    assert np.allclose(ours, np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055),
                       atol=0.005 / 255)


def test_srgb_back_to_light(context):
    """To a fiftieth of a code value of 255."""
    codes = np.linspace(0, 1, 1000, dtype=np.float32)[:, None].repeat(3, 1)
    light = evaluate(context, COLOR, "result.rgb = linear_from_srgb(a.rgb);", codes)[:, 0].astype(np.float64)
    again = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)
    assert np.abs(again - codes[:, 0]).max() * 255 < 0.02
