"""Which triangles of a mesh bound a solid body."""

from __future__ import annotations

import numpy as np

from ssil_viewer.scene.model import Mesh

_LEAST_VOLUME = 1e-6
"""Volume over area^1.5 from which on a closed surface is a body (a sphere has 0.094): a sheet with two coincident sides
encloses nothing but rounding."""


def solid_triangles(mesh: Mesh, opaque: np.ndarray) -> np.ndarray:
    """Triangles of the pieces of a mesh that are closed and look outwards.

    Vertices at the same position are one. Pieces are what hangs together by shared vertices. A piece is closed when
    each of its edges is passed equally often in both directions, and a body when its faces look outwards, all of them
    are opaque, and it has a volume. A room whose faces look inwards is closed, too, but its inside is empty.

    Args:
        mesh: The mesh.
        opaque: (P,) bool, of each primitive: no part of it may be discarded.

    Returns:
        (T,) bool, over the triangles of all primitives in order.
    """
    counts = [len(p.indices) for p in mesh.primitives]
    positions = np.concatenate([p.positions for p in mesh.primitives])
    starts = np.cumsum([0, *(len(p.positions) for p in mesh.primitives)])
    corners = np.concatenate([p.indices.astype(np.int64) + start for p, start in zip(mesh.primitives, starts)])
    if not len(corners):
        return np.zeros(0, bool)
    weld = _weld(positions)
    triangles = weld[corners]
    piece = _pieces(triangles, len(positions))[triangles[:, 0]]
    pieces = int(piece.max()) + 1

    excluded = _edge_balance(triangles, piece, pieces) != 0
    excluded[piece[~np.repeat(opaque, counts)]] = True
    a, b, c = (positions[corners[:, at]].astype(np.float64) - positions.mean(axis=0) for at in range(3))
    cross = np.cross(b - a, c - a)
    volume = np.bincount(piece, np.einsum("ti,ti->t", a, cross) / 6.0, pieces)
    area = np.bincount(piece, np.sqrt(np.einsum("ti,ti->t", cross, cross)) / 2.0, pieces)
    return (~excluded & (volume > _LEAST_VOLUME * area**1.5))[piece]


def _mixed(numbers: np.ndarray) -> np.ndarray:
    """uint64 to uint64, one to one, the results as if random. Source: Steele et al. 2014, SplitMix64."""
    numbers = (numbers ^ (numbers >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    numbers = (numbers ^ (numbers >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return numbers ^ (numbers >> np.uint64(31))


def _weld(positions: np.ndarray) -> np.ndarray:
    """(V,) int64: the same number for equal positions, below V."""
    bits = (positions + np.float32(0.0)).view(np.uint32).astype(np.uint64)      # -0 is 0
    # Sorting one number is several times faster than sorting rows; unlike rows with equal ones would be found out
    keys = _mixed(bits[:, 0] | (bits[:, 1] << np.uint64(32))) ^ bits[:, 2]
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    if (bits[first[inverse]] != bits).any():
        inverse = np.unique(bits, axis=0, return_inverse=True)[1].ravel()
    return inverse.astype(np.int64)


def _pieces(triangles: np.ndarray, vertices: int) -> np.ndarray:
    """(V,) int64: numbers from 0 on of the connected pieces that vertices belong to.

    Source: Shiloach and Vishkin 1982, "An O(log n) Parallel Connectivity Algorithm": hook roots to smaller neighbours,
    then shorten all paths.
    """
    parent = np.arange(vertices)
    a, b, c = triangles.T
    while len(a):
        roots = parent[a], parent[b], parent[c]
        least = np.minimum(np.minimum(roots[0], roots[1]), roots[2])
        for root in roots:
            np.minimum.at(parent, root, least)
        while not np.array_equal(shorter := parent[parent], parent):
            parent = shorter
        # What has one root keeps having one
        apart = (parent[a] != parent[b]) | (parent[b] != parent[c])
        a, b, c = a[apart], b[apart], c[apart]
    return np.unique(parent, return_inverse=True)[1]


def _edge_balance(triangles: np.ndarray, piece: np.ndarray, pieces: int) -> np.ndarray:
    """(pieces,) int64: 0 where each edge is passed equally often in both directions.

    Each edge has a random number that counts plus in one direction and minus in the other. That a sum of unmatched
    ones is zero has a probability of 2^-64.
    """
    balance = np.zeros(pieces, np.int64)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b = triangles[:, start], triangles[:, end]
        edge = (np.minimum(a, b) << 32) | np.maximum(a, b)
        np.add.at(balance, piece, _mixed(edge.view(np.uint64)).view(np.int64) * np.sign(b - a))
    return balance
