"""Encodings of render targets: round trips, ranges, and what becomes of values that fit no range."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gpu_function import evaluate

PACKING = ("lib/packing.glsl",)
LARGEST = 65408.0


def rgb9e5_twin(color: np.ndarray) -> np.ndarray:
    """Decoded value after encoding, by the rule of EXT_texture_shared_exponent, float64."""
    c = np.clip(np.nan_to_num(color.astype(np.float64), nan=0.0, posinf=LARGEST, neginf=0.0), 0, LARGEST)
    largest = c.max(-1)
    exponent = np.maximum(-16, np.floor(np.log2(np.maximum(largest, 1e-38)))) + 16
    scale = 2.0 ** (24 - exponent)
    over = np.floor(largest * scale + 0.5) == 512
    scale = np.where(over, scale / 2, scale)
    return np.floor(c * scale[:, None] + 0.5) / scale[:, None]


def colors() -> np.ndarray:
    rng = np.random.default_rng(3)
    wide = 10.0 ** rng.uniform(-9, 6, (2000, 3))
    edge = np.array([(0, 0, 0), (1, 1, 1), (0.5, 0.25, 511 / 512), (511.5, 1, 0), (LARGEST, 0, 1), (65535, 1, 1),
                     (1e30, 1, 1), (-1, 2, 3), (-1e30, -1, 0), (1e-20, 0, 0), (2**-16, 2**-17, 0)])
    return np.concatenate([wide, edge]).astype(np.float32)


def test_rgb9e5_follows_the_extension(context):
    values = colors()
    decoded = evaluate(context, PACKING, "result.rgb = decode_rgb9e5(encode_rgb9e5(a.rgb));", values)[:, :3]
    assert np.array_equal(decoded, rgb9e5_twin(values).astype(np.float32))
    largest = values.max(-1)
    exact = (largest > 2.0**-14) & (largest < LARGEST)
    error = np.abs(decoded - np.maximum(values, 0))[exact] / largest[exact, None]
    # Half a step of nine bits, of which the largest uses the upper half: 0.5 / 256. The carry adds a little.
    assert error.max() <= 2.0**-9 * 1.01


def test_rgb9e5_swallows_what_is_no_number(context):
    values = np.array([(np.nan, 1, 2), (np.inf, 1, 2), (-np.inf, 1, 2), (np.nan,) * 3], np.float32)
    decoded = evaluate(context, PACKING, "result.rgb = decode_rgb9e5(encode_rgb9e5(a.rgb));", values)[:, :3]
    assert decoded[0] == pytest.approx((0, 1, 2), rel=1e-2)
    assert decoded[1, 0] == LARGEST
    assert decoded[2] == pytest.approx((0, 1, 2), rel=1e-2)
    assert not decoded[3].any()


def test_bytes_are_the_nearest_and_stay_in_their_range(context):
    values = np.array([(0, 1, 0.5, 127 / 255), (-1, 2, 1 / 255, 254.4 / 255), (np.inf, -np.inf, 0.001, 0.003)],
                      np.float32)
    code = "uint n = encode_rgba8(a); result = vec4(n & 255u, (n >> 8) & 255u, (n >> 16) & 255u, n >> 24);"
    assert evaluate(context, PACKING, code, values).tolist() == [[0, 255, 128, 127], [0, 255, 1, 254], [255, 0, 0, 1]]


def unit_vectors(count: int) -> np.ndarray:
    v = np.random.default_rng(5).normal(size=(count, 3))
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32)


def test_directions_survive_half_floats(context):
    """As a half float stores them, whatever it does with what it cannot hold: the number is one of its normal ones."""
    vectors = np.concatenate([unit_vectors(4000), np.eye(3), -np.eye(3)]).astype(np.float32)
    code = evaluate(context, PACKING, "result.x = encode_direction16(a.xyz);", vectors)[:, 0]
    halves = code.astype(np.float16)
    assert np.array_equal(halves.astype(np.float32), code)
    assert np.abs(halves).min() >= np.finfo(np.float16).tiny and np.isfinite(halves).all()
    decoded = evaluate(context, PACKING, "result.xyz = decode_direction16(a.x);", code[:, None])[:, :3]
    angle = np.degrees(np.arccos(np.clip((decoded * vectors).sum(-1), -1, 1)))
    assert angle.max() < 1.0
    assert angle[-6:].max() < 0.05      # axes


def test_surface_keeps_depth_exactly_and_the_normal_to_a_tenth_of_a_degree(context):
    normals = np.concatenate([unit_vectors(4000), np.eye(3), -np.eye(3)]).astype(np.float32)
    depths = (10.0 ** np.random.default_rng(6).uniform(-6, 9, len(normals))).astype(np.float32)
    depths[:2] = 0, 1e-30
    out = evaluate(context, PACKING, "Surface s = decode_surface(encode_surface(Surface(a.w, a.xyz, 1.0)));"
                   "result = vec4(s.normal, s.view_depth);", np.concatenate([normals, depths[:, None]], 1))
    assert np.array_equal(out[:, 3], depths)
    assert np.abs(out[:, :3] - normals).max() < 0.001
    cosine = (out[:, :3] * normals).sum(-1) / np.linalg.norm(out[:, :3], axis=1)
    # Half a step of 1/511 in each of three components: at most sqrt(2) * 0.5 / 511 rad = 0.08 degrees across
    assert np.degrees(np.arccos(np.clip(cosine.astype(np.float64), -1, 1))).max() < 0.1
    assert np.array_equal(out[-6:, :3], normals[-6:]), "the axes are exact"


def test_surface_keeps_its_share_of_the_footprint_in_thirds(context):
    shares = np.array([0, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1, 2, -1], np.float32)
    out = evaluate(context, PACKING, "Surface s = Surface(3.0, vec3(-1.0, 0.6, -0.8), a.x);"
                   "s = decode_surface(encode_surface(s)); result = vec4(s.normal, s.whole);", shares[:, None])
    assert np.allclose(out[:, 3], np.round(np.clip(shares, 0, 1) * 3) / 3, atol=1e-6)
    assert (out[:, :3] == out[0, :3]).all() and out[0, 0] == -1.0, "the normal has the other 30 bits"


def test_surface_of_a_normal_that_is_too_long_stays_in_range(context):
    values = np.array([(5, -5, 0.5, 1), (1e30, 0, -1e30, 1)], np.float32)
    out = evaluate(context, PACKING, "Surface s = decode_surface(encode_surface(Surface(a.w, a.xyz, 1.0)));"
                   "result = vec4(s.normal, s.view_depth);", values)
    assert np.abs(out[:, :3]).max() == 1.0


def test_lobe_round_trip(context):
    rng = np.random.default_rng(7)
    flux = 10.0 ** rng.uniform(-3, 3, (1000, 3))
    directions = unit_vectors(1000) * rng.uniform(0, 1, (1000, 1))
    back = np.concatenate([[0, 1, 128], 10.0 ** rng.uniform(-2, 1, 997)])
    body = "Lobe l = decode_lobe(encode_lobe(Lobe(a.rgb, b.xyz, b.w)));"
    inputs = flux, np.concatenate([directions, back[:, None]], 1)
    out_flux = evaluate(context, PACKING, body + "result.rgb = l.flux;", *inputs)[:, :3]
    out = evaluate(context, PACKING, body + "result = vec4(l.direction, l.back);", *inputs)
    assert np.array_equal(out_flux, rgb9e5_twin(flux.astype(np.float32)).astype(np.float32))
    assert np.abs(out[:, :3] - directions).max() <= 0.5 / 127 + 1e-6
    assert out[0, 3] == 0
    # back / (1 + back) in steps of 1/255: half a step is (1 + back)^2 / 510 of back
    small = back < 10
    assert (np.abs(out[:, 3] - back)[small] <= (1 + back[small]) ** 2 / 510 * 1.2 + 1e-3).all()
    assert np.isfinite(out).all()


def test_quantized_lobe_direction_is_what_decoding_gives(context):
    directions = unit_vectors(500)
    out = evaluate(context, PACKING, "vec3 q = quantize_lobe_direction(a.xyz);"
                   "Lobe l = decode_lobe(encode_lobe(Lobe(vec3(1.0), q, 0.0)));"
                   "result.xyz = l.direction - q;", directions)
    assert np.abs(out[:, :3]).max() < 1e-6


def test_reflectance_round_trip_through_eight_bits(context):
    values = np.linspace(-0.5, 1.5, 600, dtype=np.float32)[:, None].repeat(4, 1)
    encoded = evaluate(context, PACKING, "result = encode_reflectance(a);", values)
    stored = np.round(np.clip(encoded, 0, 1) * 255) / 255
    decoded = evaluate(context, PACKING, "result = decode_reflectance(a);", stored)
    clamped = np.clip(values, 0, 1)
    # d(s^2) = 2 s ds with ds = half a code value
    assert (np.abs(decoded - clamped)[:, :3] <= np.sqrt(clamped[:, :3]) / 255 + 1e-5).all()
    assert np.abs(decoded[:, 3] - clamped[:, 3]).max() <= 0.5 / 255 + 1e-6
    assert (decoded[clamped[:, 0] > 0.00001, 0] > 0).all(), "dark is not black"


def test_reflections(context):
    """Roughness and spread to 1e-4; negative roughness, where nothing reflects, stays negative."""
    values = np.array([(1, 2, 3, 0.0), (0, 0, 0, 1.0), (4, 5, 6, 0.2), (1, 1, 1, -1.0)], np.float32)
    spread = np.array([[0.0], [4.0], [0.37], [9.0]], np.float32)
    body = "Reflection r = decode_reflection(encode_reflection(Reflection(a.rgb, a.a, b.r))); "
    found = evaluate(context, PACKING, body + "result = vec4(r.radiance, r.roughness);", values, spread)
    assert found[:, :3] == pytest.approx(values[:, :3], rel=1e-2)
    assert found[:3, 3] == pytest.approx(values[:3, 3], abs=1e-4) and found[3, 3] < 0
    found = evaluate(context, PACKING, body + "result.r = r.spread;", values, spread)[:, 0]
    assert found == pytest.approx([0, 4, 0.37, 4], abs=1e-4)
