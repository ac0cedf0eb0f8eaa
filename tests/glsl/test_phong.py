"""The glossy lobe: its exponent, its normalization, its cone."""

from __future__ import annotations

import numpy as np
import pytest

from tests.glossy_reference import exponent, lobe_albedo
from tests.gpu_function import evaluate

PHONG = ("lib/phong.glsl",)


def test_exponent_of_a_roughness(context):
    roughness = np.linspace(0, 1, 101, dtype=np.float32)
    found = evaluate(context, PHONG, "result.r = phong_exponent(a.r);", roughness[:, None])[:, 0]
    assert found == pytest.approx(exponent(roughness.astype(np.float64)), rel=1e-3)
    assert found[20] == pytest.approx(312, rel=1e-3), "roughness 0.2: 1 / (2 * 0.04^2) - 1/2"


def test_normalization(context):
    """Within 1.6 % of quadrature, for lobes from the widest to the narrowest and all angles."""
    e, c = (v.ravel() for v in np.meshgrid(np.geomspace(1, 10000, 25), np.linspace(0.001, 1, 41)))
    found = evaluate(context, PHONG, "result.r = phong_albedo(a.r, a.g);", np.stack([e, c], -1).astype(np.float32))
    assert found[:, 0] == pytest.approx(lobe_albedo(e, c), rel=0.016)


def test_quadrature_of_the_reference():
    """(e + 2) / (2 pi) is the normalization for a mirror direction along the normal, and for e = 1 and one along the
    surface the integral of cos delta cos theta over a quarter sphere is 2/3 of it: 3 / (2 pi) * 2/3 = 1 / pi."""
    e = np.array([1.0, 7.5, 312.0, 10000.0])
    assert lobe_albedo(e, np.ones(4)) == pytest.approx(np.ones(4), rel=1e-6)
    assert lobe_albedo(np.array([1.0]), np.zeros(1))[0] == pytest.approx(1 / np.pi, rel=1e-6)


def test_the_cone_holds_the_lobe(context):
    e = np.array([1, 3, 30, 312, 10000], np.float32)
    cosine = evaluate(context, PHONG, "result.r = lobe_cone_cos(a.r);", e[:, None])[:, 0].astype(np.float64)
    assert cosine**e == pytest.approx(np.full(5, 0.01), rel=0.02)


def test_widened_lobes(context):
    """Never narrower than before, never below zero, and as wide as the disc where that is much wider than the lobe."""
    values = np.array([(312, 0), (312, 1e-3), (312, 100), (10000, 0.04), (1, 1e6)], np.float32)
    found = evaluate(context, PHONG, "result.r = a.r * narrowing_by_disc(a.r, 7.0 * a.g, 7.0);", values)[:, 0]
    assert found[0] == 312 and (found >= 0).all() and (np.diff(found[:3]) < 0).all()
    assert found[3] == pytest.approx(100, rel=0.02), "4 / 0.04"
