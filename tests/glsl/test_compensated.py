"""Sums in shaders that do not drift."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gpu_function import evaluate


def test_a_long_sum_keeps_single_precision(context):
    """60,000 addends: to 2e-7 of the sum in double precision, where a plain sum is off by more than 2e-6: 20 times that
    with llvmpipe, 3 times with a NVIDIA H200, whose compiler sums in another order.
    (llvmpipe makes no more than 65535 turns of a loop.)"""
    addends = np.random.default_rng(1).uniform(0.05, 0.15, (8, 4)).astype(np.float32)
    addends[:, 3] = 1.0
    found = [evaluate(context, ("lib/compensated.glsl",),
                      f"vec3 sum = vec3(0.0), lost = vec3(0.0); for (int i = 0; i < 60000; ++i) {step} "
                      "result.xyz = sum - lost;", addends)[:, :3]
             for step in ("add_compensated(sum, lost, a.xyz, a.w);", "sum += a.xyz;")]
    exact = addends[:, :3].astype(np.float64) * 60_000
    assert found[0] == pytest.approx(exact, rel=2e-7)
    assert np.abs(found[1] / exact - 1).max() > 2e-6
