"""Turns the vertex arrays of any file format into a valid `Primitive`: cleans, splits, computes what is missing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ssil_viewer.scene.model import Material, Primitive, TextureRef
from ssil_viewer.scene.warning_list import WarningList

_DEGENERATE = 1e-24
"""Triangles with (2 area)^2 below this fraction of their longest edge^4 are dropped: twice the area is then less
than 1e-12 of the square of that edge, far below what float32 corners can express."""


@dataclass(frozen=True, eq=False)
class VertexArrays:
    """A triangle list as a file gives it; anything may be missing, not finite or inconsistent.

    Attributes:
        positions: (V, 3) float.
        indices: (T, 3) integers; out-of-range ones are allowed.
        normals: (V, 3) float or None.
        tangents: (V, 4) float or None.
        texcoords: (V, 2, 2) float or None.
        colors: (V, 4) float linear RGBA or None.
    """

    positions: np.ndarray
    indices: np.ndarray
    normals: np.ndarray | None = None
    tangents: np.ndarray | None = None
    texcoords: np.ndarray | None = None
    colors: np.ndarray | None = None

    def take(self, vertices: np.ndarray, indices: np.ndarray) -> VertexArrays:
        """The arrays reordered to `vertices`, with new triangles."""

        def pick(array: np.ndarray | None) -> np.ndarray | None:
            return None if array is None else array[vertices]

        return VertexArrays(
            self.positions[vertices],
            indices,
            pick(self.normals),
            pick(self.tangents),
            pick(self.texcoords),
            pick(self.colors),
        )


def build_primitive(
    arrays: VertexArrays, material_index: int, material: Material, label: str, warnings: WarningList
) -> Primitive | None:
    """Makes a primitive that keeps every promise of `Primitive`.

    Triangles with missing or non-finite corners and degenerate ones are dropped; missing normals become flat
    ones, broken normals are rebuilt; tangents are computed when the material has a normal map and the file
    gives none.

    Args:
        arrays: The file's data.
        material_index: Stored in the primitive.
        material: That material.
        label: The mesh's name, for warnings.
        warnings: Receives what was repaired.

    Returns:
        The primitive, or None when no triangle is left.
    """
    arrays = _compact(_drop_triangles_without_vertices(arrays, label, warnings))
    arrays = _compact(_drop_bad_triangles(arrays, label, warnings))
    if not len(arrays.indices):
        return None
    if arrays.normals is None:
        arrays = _flat_shaded(arrays)
    else:
        arrays = replace(arrays, normals=_repair_normals(arrays, label, warnings))
    arrays = replace(
        arrays,
        texcoords=_finite_or(arrays.texcoords, 0.0, "texture coordinates", label, warnings),
        colors=_finite_or(arrays.colors, 1.0, "vertex colours", label, warnings),
    )
    if material.normal_texture is None:
        arrays = replace(arrays, tangents=None)
    else:
        arrays = _with_tangents(arrays, material.normal_texture)

    count = len(arrays.positions)
    texcoords = np.zeros((count, 2, 2), np.float32) if arrays.texcoords is None else arrays.texcoords
    colors = arrays.colors
    if colors is not None:
        colors = None if np.all(colors == 1.0) else np.ascontiguousarray(np.maximum(colors, 0.0), np.float32)
    return Primitive(
        np.ascontiguousarray(arrays.positions, np.float32),
        np.ascontiguousarray(arrays.normals, np.float32),
        None if arrays.tangents is None else np.ascontiguousarray(arrays.tangents, np.float32),
        np.ascontiguousarray(texcoords, np.float32),
        colors,
        np.ascontiguousarray(arrays.indices, np.uint32),
        material_index,
    )


def _compact(arrays: VertexArrays) -> VertexArrays:
    """Drops the vertices that no triangle uses: primitives often share one large vertex buffer."""
    used = np.zeros(len(arrays.positions), dtype=bool)
    used[arrays.indices.reshape(-1)] = True
    if used.all():
        return arrays
    new_index = np.cumsum(used) - 1
    return arrays.take(np.flatnonzero(used), new_index[arrays.indices])


def _drop_triangles_without_vertices(arrays: VertexArrays, label: str, warnings: WarningList) -> VertexArrays:
    """Drops triangles with corners outside of the arrays."""
    inside = np.all((arrays.indices >= 0) & (arrays.indices < len(arrays.positions)), axis=1)
    if inside.all():
        return arrays
    warnings.add("triangles with vertices that do not exist were dropped", label, int(np.sum(~inside)))
    return replace(arrays, indices=arrays.indices[inside])


def _drop_bad_triangles(arrays: VertexArrays, label: str, warnings: WarningList) -> VertexArrays:
    """Drops triangles that have no area or corners that are not finite."""
    indices = arrays.indices
    finite = np.all(np.isfinite(arrays.positions.astype(np.float32, copy=False)), axis=1)
    if not finite.all():
        good = np.all(finite[indices], axis=1)
        warnings.add("triangles with positions that are not finite were dropped", label, int(np.sum(~good)))
        indices = indices[good]
    if len(indices):
        corners = arrays.positions[indices].astype(np.float64)
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        doubled_area = np.cross(first, second)
        third = second - first
        longest = np.maximum(np.maximum(_dot(first, first), _dot(second, second)), _dot(third, third))
        solid = _dot(doubled_area, doubled_area) > _DEGENERATE * longest * longest
        if not solid.all():
            warnings.add("triangles without area, of which nothing is seen, were left out", label, int(np.sum(~solid)))
            indices = indices[solid]
    return replace(arrays, indices=indices)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Dot products along the last axis."""
    return np.einsum("...i,...i->...", a, b)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors along the last axis scaled to length 1; what has no direction stays zero."""
    squared = _dot(vectors, vectors)[..., None]
    if not np.all((squared > 1e-280) & (squared < 1e280)):
        # Squares of tiny or huge vectors leave the range of numbers: bring the largest component to 1 first.
        largest = np.max(np.abs(vectors), axis=-1, keepdims=True, initial=0.0)
        vectors = vectors / np.where(largest > 0.0, largest, 1.0)
        squared = _dot(vectors, vectors)[..., None]
    return vectors / np.where(squared > 0.0, np.sqrt(squared), 1.0)


def face_normals(positions: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Unit normals of counter-clockwise triangles, (T, 3) float64."""
    corners = positions[indices].astype(np.float64)
    return _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def corner_angles(positions: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Interior angles of triangles in radians, (T, 3) float64."""
    corners = positions[indices].astype(np.float64)
    edges = _unit(np.roll(corners, -1, axis=1) - corners)  # edge k goes from corner k to corner k + 1
    return np.arccos(np.clip(-_dot(edges, np.roll(edges, 1, axis=1)), -1.0, 1.0))


def sum_per_group(groups: np.ndarray, vectors: np.ndarray, count: int) -> np.ndarray:
    """Sums of (N, 3) vectors by their (N,) group number, (count, 3) float64."""
    return np.stack([np.bincount(groups, vectors[:, axis], count) for axis in range(vectors.shape[1])], axis=1)


def smooth_normals(positions: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Vertex normals as the angle-weighted mean of the faces around, (V, 3) float64, zero where there is no face."""
    weighted = face_normals(positions, indices)[:, None] * corner_angles(positions, indices)[..., None]
    return _unit(sum_per_group(indices.reshape(-1), weighted.reshape(-1, 3), len(positions)))


def _flat_shaded(arrays: VertexArrays) -> VertexArrays:
    """Gives each triangle its own vertices with the face normal (what glTF asks for when normals are missing).

    Tangents go: without normals glTF has them ignored.
    """
    normals = np.repeat(face_normals(arrays.positions, arrays.indices), 3, axis=0)
    corners = arrays.indices.reshape(-1)
    split = arrays.take(corners, np.arange(len(corners)).reshape(-1, 3))
    return replace(split, normals=normals, tangents=None)


def _repair_normals(arrays: VertexArrays, label: str, warnings: WarningList) -> np.ndarray:
    """Unit normals; those that are zero or not finite are rebuilt from the faces around."""
    normals = arrays.normals.astype(np.float64)
    broken = ~np.all(np.isfinite(normals), axis=1) | ~np.any(normals, axis=1)
    if broken.any():
        warnings.add("broken normals were rebuilt from the faces", label, int(broken.sum()))
        normals[broken] = smooth_normals(arrays.positions, arrays.indices)[broken]
        # Faces that cancel each other out leave no mean: any one of them will do.
        lost = broken & ~np.any(normals, axis=1)
        if lost.any():
            faces = face_normals(arrays.positions, arrays.indices)
            of_vertex = np.zeros((len(normals), 3))
            of_vertex[arrays.indices] = faces[:, None]
            normals[lost] = of_vertex[lost]
    return _unit(normals)


def _finite_or(
    values: np.ndarray | None, default: float, what: str, label: str, warnings: WarningList
) -> np.ndarray | None:
    """The values, with a default in place of what is not finite as float32."""
    if values is None:
        return None
    values = values.astype(np.float32, copy=False)
    finite = np.isfinite(values)
    if finite.all():
        return values
    warnings.add(f"{what} that are not finite were replaced", label, int(np.sum(~finite)))
    return np.where(finite, values, np.float32(default))


def transformed_texcoords(texcoords: np.ndarray, ref: TextureRef) -> np.ndarray:
    """The coordinates at which a texture is looked up, (V, 2) float64, from (V, 2, 2) UV sets.

    A counter-clockwise turn, seen with v pointing down: u' = cos u + sin v, v' = cos v - sin u.
    """
    scaled = texcoords[:, ref.texcoord].astype(np.float64) * ref.scale
    c, s = np.cos(ref.rotation), np.sin(ref.rotation)
    return scaled @ np.array([[c, -s], [s, c]]) + ref.offset


def _with_tangents(arrays: VertexArrays, ref: TextureRef) -> VertexArrays:
    """Cleans the file's tangents, or computes them when there are none that can be used."""
    if arrays.tangents is not None:
        xyz = arrays.tangents[:, :3].astype(np.float64)
        xyz = xyz - arrays.normals * _dot(arrays.normals, xyz)[:, None]
        if np.all(np.isfinite(arrays.tangents)) and np.all(_dot(xyz, xyz) > 1e-12):
            sign = np.where(arrays.tangents[:, 3] < 0.0, -1.0, 1.0)
            return replace(arrays, tangents=np.concatenate([_unit(xyz), sign[:, None]], axis=1))
    return compute_tangents(arrays, ref)


def compute_tangents(arrays: VertexArrays, ref: TextureRef) -> VertexArrays:
    """Computes tangents from normals and the coordinates of the normal map.

    The tangent points along +u. glTF's bitangent points along -v, since its v grows downwards while the
    green channel of a normal map points up: w is +1 where the picture is not mirrored.

    Source: Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited": per-face tangents, projected into
        each corner's plane, weighted by the corner's angle.
    Differs: corners are joined by vertex index, not by equal values.

    Args:
        arrays: With normals; vertices shared by mirrored and unmirrored triangles are split.
        ref: The normal map, for its UV set and transform.

    Returns:
        The arrays with (V', 4) tangents, V' >= V.
    """
    positions = arrays.positions.astype(np.float64)
    if arrays.texcoords is None:
        sign = np.ones((len(positions), 1))
        return replace(arrays, tangents=np.concatenate([_perpendicular(arrays.normals), sign], axis=1))
    uv = transformed_texcoords(arrays.texcoords, ref)[arrays.indices]
    corners = positions[arrays.indices]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    uv1, uv2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    determinant = uv1[:, 0] * uv2[:, 1] - uv2[:, 0] * uv1[:, 1]
    along_u = _unit((edge1 * uv2[:, 1:] - edge2 * uv1[:, 1:]) * np.sign(determinant)[:, None])

    arrays, sign = _split_mirrored(arrays, determinant)
    normals = arrays.normals[arrays.indices]
    projected = _unit(along_u[:, None] - normals * _dot(normals, along_u[:, None])[..., None])
    weighted = projected * corner_angles(arrays.positions, arrays.indices)[..., None]
    tangents = sum_per_group(arrays.indices.reshape(-1), weighted.reshape(-1, 3), len(arrays.positions))
    # The mean of tangents in one plane lies in it; rounding is taken out again.
    tangents = _unit(tangents - arrays.normals * _dot(arrays.normals, tangents)[:, None])
    lost = ~np.any(tangents, axis=1)
    tangents[lost] = _perpendicular(arrays.normals[lost])
    return replace(arrays, tangents=np.concatenate([tangents, sign[:, None]], axis=1))


def _split_mirrored(arrays: VertexArrays, determinant: np.ndarray) -> tuple[VertexArrays, np.ndarray]:
    """Splits the vertices that mirrored and unmirrored triangles share.

    Args:
        arrays: Any.
        determinant: (T,) signed area in the texture; positive is mirrored, since v grows downwards, and zero
            goes with whichever neighbours there are.

    Returns:
        The arrays, and the (V',) sign of each vertex, -1 where mirrored.
    """
    present = np.zeros(2 * len(arrays.positions), dtype=bool)
    groups = 2 * arrays.indices.astype(np.int64) + (determinant > 0.0)[:, None]
    flat = determinant == 0.0
    present[groups[~flat]] = True
    only_mirrored = ~present[groups[flat]] & present[groups[flat] + 1]
    groups[flat] += only_mirrored
    present[groups[flat]] = True
    kept = np.flatnonzero(present)
    new_index = np.cumsum(present) - 1
    return arrays.take(kept // 2, new_index[groups]), np.where(kept % 2, -1.0, 1.0)


def _perpendicular(normals: np.ndarray) -> np.ndarray:
    """Some unit vectors perpendicular to unit normals, (N, 3)."""
    axis = np.where(np.abs(normals[:, :1]) < 0.7, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    return _unit(np.cross(axis, normals))
