"""A bounding volume hierarchy over triangles, built with NumPy, in the order in which shaders walk it without a stack.

Source: Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies": splits by the surface area heuristic
over bins of the centroids. Differs: all nodes of one depth are split at once, as array operations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BINS = 16
"""Of the centroids along each axis, as in the paper."""

LEAF = 4
"""Triangles of a leaf at most: fewer would double the nodes, whose texels a ray reads too."""


@dataclass(frozen=True)
class TriangleTree:
    """Nodes in depth-first order.

    A walk tests a node's box. If the ray meets it, the walk goes on with the next node, otherwise with `skip`, which
    lies behind everything below the node. Past the last node it ends.

    Attributes:
        low, high: (N, 3) float32, boxes, larger than their triangles by what rounding may take off.
        skip: (N,) the node behind all below this one.
        first: (N,) the first triangle of a leaf, an index into `order`; -1 for inner nodes.
        order: (T,) triangles, so that those of a leaf are neighbours.
        last: (T,) bool, whether a place of `order` is the last one of its leaf.
    """

    low: np.ndarray
    high: np.ndarray
    skip: np.ndarray
    first: np.ndarray
    order: np.ndarray
    last: np.ndarray


@dataclass
class _Generation:
    """Nodes of one depth, in order: segments of the tree's `order`."""

    begin: np.ndarray
    end: np.ndarray
    low: np.ndarray
    high: np.ndarray
    is_leaf: np.ndarray


def build_tree(triangles: np.ndarray) -> TriangleTree:
    """The tree of (T, 3, 3) float32 triangles."""
    count = len(triangles)
    low, high = triangles.min(1), triangles.max(1)
    centroid = (low + high) / 2
    order = np.arange(count)
    begin, end = np.array([0]), np.array([count])
    generations: list[_Generation] = []
    while count and len(begin):
        boxes = _per_segment(np.minimum, low[order], begin, end), _per_segment(np.maximum, high[order], begin, end)
        is_leaf = end - begin <= LEAF
        generations.append(_Generation(begin, end, *boxes, is_leaf))
        begin, end = _split(low, high, centroid, order, begin[~is_leaf], end[~is_leaf])
    return _threaded(generations, order)


def _per_segment(reduce: np.ufunc, values: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Reduces values[begin:end] of each segment; segments are in order, not empty, and do not overlap."""
    padded = np.concatenate([values, values[-1:]])
    return reduce.reduceat(padded, np.stack([begin, end], 1).ravel(), axis=0)[::2]


def _split(low: np.ndarray, high: np.ndarray, centroid: np.ndarray, order: np.ndarray, begin: np.ndarray,
           end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Halves segments of `order`, which is sorted within them. Returns begin and end of both halves of each."""
    if not len(begin):
        return begin, end
    sizes = end - begin
    node = np.repeat(np.arange(len(begin)), sizes)
    place = np.arange(len(node)) - np.repeat(np.cumsum(sizes) - sizes, sizes) + np.repeat(begin, sizes)
    item = order[place]
    right = _best_side(low[item], high[item], centroid[item], node, len(begin))
    left_sizes = sizes - np.bincount(node, right, len(begin)).astype(int)
    # All centroids in one place, or no plane found: by number
    stuck = (left_sizes == 0) | (left_sizes == sizes)
    by_number = place - begin[node] >= (sizes // 2)[node]
    right = np.where(stuck[node], by_number, right)
    left_sizes = np.where(stuck, sizes // 2, left_sizes)
    order[place] = item[np.argsort(node * 2 + right, kind="stable")]
    middle = begin + left_sizes
    return np.stack([begin, middle], 1).ravel(), np.stack([middle, end], 1).ravel()


def _best_side(low: np.ndarray, high: np.ndarray, centroid: np.ndarray, node: np.ndarray, nodes: int) -> np.ndarray:
    """(T,) bool: which triangles go to the right under the cheapest of all planes between bins."""
    starts = np.searchsorted(node, np.arange(nodes))
    least, most = np.minimum.reduceat(centroid, starts), np.maximum.reduceat(centroid, starts)
    spread = np.maximum(most - least, 1e-30)
    best_cost = np.full(nodes, np.inf)
    right = np.zeros(len(node), bool)
    for axis in range(3):
        bins = np.clip((centroid[:, axis] - least[node, axis]) / spread[node, axis] * BINS, 0, BINS - 1).astype(int)
        cost = _plane_costs(low, high, node * BINS + bins, nodes)
        plane = cost.argmin(1)
        cost = cost[np.arange(nodes), plane]
        better = cost < best_cost
        best_cost = np.where(better, cost, best_cost)
        right = np.where(better[node], bins > plane[node], right)
    return right


def _plane_costs(low: np.ndarray, high: np.ndarray, key: np.ndarray, nodes: int) -> np.ndarray:
    """(nodes, BINS - 1): sum over both sides of area times number; infinite where a side is empty."""
    count = np.bincount(key, minlength=nodes * BINS).reshape(nodes, BINS)
    bin_low = np.full((3, nodes * BINS), np.inf, np.float32)
    bin_high = np.full((3, nodes * BINS), -np.inf, np.float32)
    for axis in range(3):
        np.minimum.at(bin_low[axis], key, np.ascontiguousarray(low[:, axis]))
        np.maximum.at(bin_high[axis], key, np.ascontiguousarray(high[:, axis]))
    bin_low, bin_high = bin_low.reshape(3, nodes, BINS), bin_high.reshape(3, nodes, BINS)

    def side(turned: slice) -> tuple[np.ndarray, np.ndarray]:
        size = (np.maximum.accumulate(bin_high[..., turned], -1) - np.minimum.accumulate(bin_low[..., turned], -1))
        x, y, z = size.astype(np.float64)
        number = np.cumsum(count[:, turned], 1)
        with np.errstate(invalid="ignore"):     # an empty box is as large as infinity is negative
            area = np.where(number > 0, x * y + y * z + z * x, 0)
        return area[:, turned], number[:, turned]

    (area_left, left), (area_right, right) = side(slice(None)), side(slice(None, None, -1))
    cost = area_left[:, :-1] * left[:, :-1] + area_right[:, 1:] * right[:, 1:]
    return np.where((left[:, :-1] > 0) & (right[:, 1:] > 0), cost, np.inf)


def _threaded(generations: list[_Generation], order: np.ndarray) -> TriangleTree:
    """Puts the nodes of all depths into depth-first order."""
    below: list[np.ndarray] = []    # nodes of each subtree, itself included
    for generation in reversed(generations):
        sizes = np.ones(len(generation.begin), int)
        if below:
            sizes[~generation.is_leaf] += below[-1].reshape(-1, 2).sum(1)
        below.append(sizes)
    below.reverse()
    total = int(below[0].sum()) if below else 0
    low, high = np.zeros((total, 3), np.float32), np.zeros((total, 3), np.float32)
    skip, first = np.zeros(total, int), np.full(total, -1)
    last = np.zeros(len(order), bool)
    place = np.zeros(1, int)
    for depth, (generation, sizes) in enumerate(zip(generations, below)):
        margin = 1e-6 * np.maximum(np.abs(generation.low), np.abs(generation.high)) + 1e-30
        low[place], high[place] = generation.low - margin, generation.high + margin
        skip[place] = place + sizes
        leaf, inner = generation.is_leaf, ~generation.is_leaf
        first[place[leaf]] = generation.begin[leaf]
        last[generation.end[leaf] - 1] = True
        if inner.any():
            left = place[inner] + 1
            place = np.stack([left, left + below[depth + 1].reshape(-1, 2)[:, 0]], 1).ravel()
    return TriangleTree(low, high, skip, first, order, last)
