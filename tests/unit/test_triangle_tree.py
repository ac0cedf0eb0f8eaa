"""The tree of triangles: every ray reaches the leaves of what it meets."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.scene.triangle_tree import LEAF, build_tree


def leaves_met(tree, start, end):
    """Triangles of all leaves that a walk comes to."""
    along, node, found = np.where(end == start, 1e-20, end - start), 0, []
    while node < len(tree.low):
        one, other = (tree.low[node] - start) / along, (tree.high[node] - start) / along
        if max(np.minimum(one, other).max(), 0) > min(np.maximum(one, other).min(), 1):
            node = tree.skip[node]
            continue
        if tree.first[node] >= 0:
            place = tree.first[node]
            while True:
                found.append(tree.order[place])
                if tree.last[place]:
                    break
                place += 1
        node += 1
    return set(found)


def random_triangles(count, seed=1):
    rng = np.random.default_rng(seed)
    return (rng.random((count, 1, 3)) * 10 + rng.normal(0, 0.3, (count, 3, 3))).astype(np.float32)


@pytest.mark.parametrize("count", [1, 2, LEAF, LEAF + 1, 37, 1000])
def test_a_ray_to_a_triangle_reaches_it(count):
    triangles = random_triangles(count)
    tree = build_tree(triangles)
    assert sorted(tree.order) == list(range(count))
    assert tree.last.sum() == (tree.first >= 0).sum() >= count / LEAF
    rng = np.random.default_rng(2)
    for item in rng.integers(0, count, 30):
        inside = rng.dirichlet((1, 1, 1)) @ triangles[item]
        start = rng.random(3) * 10
        assert item in leaves_met(tree, start, inside + 0.1 * (inside - start))


def test_a_short_ray_does_not_look_everywhere():
    triangles = random_triangles(2000)
    tree = build_tree(triangles)
    met = leaves_met(tree, np.full(3, 5.0), np.full(3, 5.5))
    assert len(met) < 200


@pytest.mark.parametrize("triangles", [
    np.zeros((0, 3, 3), np.float32), np.zeros((50, 3, 3), np.float32),
    np.repeat(random_triangles(1), 23, axis=0)], ids=["none", "points", "alike"])
def test_what_cannot_be_told_apart(triangles):
    tree = build_tree(triangles)
    assert sorted(tree.order) == list(range(len(triangles)))
    if len(triangles):
        assert tree.skip[0] == len(tree.low)
        middle = triangles[0].mean(0)
        assert len(leaves_met(tree, middle - 1, middle + 1)) == len(triangles)
