"""The three texels by which images are looked up between texel centres."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gpu_function import evaluate

TAPS = ("lib/taps.glsl",)


def test_taps_reproduce_what_is_linear(context):
    """Weights between 0 and 1 that sum to 1, for the texel around the place and its nearest neighbours."""
    places = np.random.default_rng(5).uniform(-3, 20, (500, 2)).astype(np.float32)
    found = []
    for i in range(3):
        body = f"Taps taps = nearest_taps(a.rg); result = vec4(vec2(taps.at[{i}]), taps.weights[{i}], 0.0);"
        found.append(evaluate(context, TAPS, body, places))
        body = f"Taps taps = nearest_taps(a.rg); result = vec4(taps.apart[{i}], 0.0, 0.0);"
        assert evaluate(context, TAPS, body, places)[:, :2] == pytest.approx(found[i][:, :2] + 0.5 - places, abs=1e-5)
    at, weights = np.stack(found)[..., :2], np.stack(found)[..., 2:3]
    assert (at[0] == np.floor(places)).all()
    assert (np.abs(at[1:] - at[0]).sum(-1) == 1).all() and (at[1] != at[2]).any(-1).all()
    assert (weights >= 0).all() and weights.sum(0) == pytest.approx(1)
    assert ((at + 0.5) * weights).sum(0) == pytest.approx(places, abs=1e-5)


def test_at_a_centre_only_that_texel_counts(context):
    weights = evaluate(context, TAPS, "result = vec4(nearest_taps(a.rg).weights, 0.0);",
                       np.array([(3.5, 7.5)], np.float32))[0, :3]
    assert weights.tolist() == [1, 0, 0]
