"""The windows that levels are denoised over, and the vote for a texel's surface."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gpu_function import evaluate

NEEDED = """
struct Rays { vec2 ray_scale, ray_origin; };
const Rays frame = Rays(vec2(1.0), vec2(0.0));
uniform int window;
uniform bool mirrored;
Surface load_surface(ivec2 px) { return Surface(0.0, vec3(0.0), 1.0); }
"""
LIBRARIES = ("lib/packing.glsl", "lib/spaces.glsl")


@pytest.mark.parametrize("columns, call, weight", [
    (range(4), "window_tap(ivec2(10, 20), int(a.x), int(a.y), ivec2(99))", "1.0"),
    (range(-2, 3), "soft_window_tap(ivec2(10, 20), int(a.x), int(a.y), ivec2(99))",
     "soft_window_weight(int(a.x), int(a.y))"),
])
def test_windows_see_each_texel_of_the_pattern_once(context, columns, call, weight):
    """Samples differ in 4x4 texels: each of these has a weight of 1 in all, and
    the middle of all is px, without a longer diagonal."""
    places = np.array([(x, y) for x in columns for y in range(len(columns))], np.float32)
    out = evaluate(context, (*LIBRARIES, "lib/bilateral.glsl"), f"result = vec4({call}, {weight}, 0.0);", places,
                   before=NEEDED)
    offsets, weights = out[:, :2].astype(int) - (10, 20), out[:, 2]
    assert len(np.unique(offsets, axis=0)) == len(columns) ** 2 and np.abs(offsets).max() == 2
    seen = np.zeros((4, 4))
    np.add.at(seen, tuple(offsets.T % 4), weights)
    assert (seen == 1).all()
    assert (offsets * weights[:, None]).sum(0).tolist() == [0, 0]
    x, y = offsets.T
    assert (x * y * weights).sum() == 0 and (x * x * weights).sum() == (y * y * weights).sum()


def test_windows_stay_in_the_image(context):
    places = np.array([(x, y) for x in range(4) for y in range(4)], np.float32)
    out = evaluate(context, (*LIBRARIES, "lib/bilateral.glsl"),
                   "result = vec4(window_tap(ivec2(0, 3), int(a.x), int(a.y), ivec2(5, 3)), 0.0, 0.0);", places,
                   before=NEEDED)
    assert (out[:, :2] >= 0).all() and (out[:, :2] <= (5, 3)).all()


def test_candidates_support_one_another(context):
    """Each adds its votes times f^5 / (1 + u)^8 to the others, f the agreement of normals and u the height over the
    tangent plane, and all of them to itself."""
    random = np.random.default_rng(3)
    count = 200
    normals = random.normal(0, 0.4, (count, 4, 3)) + (0, 0, 1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    positions = random.normal(0, 0.2, (count, 4, 3)) + (0, 0, -4)
    votes = np.array((0.25, 1.0, 0.5, 0.75))
    numbers = np.concatenate([normals, positions], -1).reshape(count, 6, 4).astype(np.float32)
    names = [f"{name}.{part}" for name in "abcdef" for part in "xyzw"]
    voters = [f"Voter(vec3({', '.join(names[at:at + 3])}), vec3({', '.join(names[at + 3:at + 6])}), 1.0)"
              for at in range(0, 24, 6)]
    ours = evaluate(context, (*LIBRARIES, "lib/vote.glsl"),
                    f"result = mutual_support(candidates_of({', '.join(voters)}), "
                    f"vec4({', '.join(map(str, votes))}));",
                    *numbers.transpose(1, 0, 2), before=NEEDED)
    facing = np.maximum(np.einsum("nik,njk->nij", normals, normals), 0)
    along = np.einsum("nik,njk->nij", normals, positions)
    above = np.abs(along - along[:, range(4), range(4), None])
    support = facing ** 5 / (1 + above / (0.15 * -positions[:, :, None, 2])) ** 8
    support[:, range(4), range(4)] = 1
    assert ours == pytest.approx(support @ votes, rel=1e-4)
    assert (support < 0.9).mean() > 0.3
