"""Points spread over all surfaces of a scene, each with the light that it sends on and the area that it stands for."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ssil_viewer.scene.model import Material, Primitive, Scene
from ssil_viewer.scene.texels import linear_from_srgb, texels_of
from ssil_viewer.scene.triangles import Mask

# Surfaces that shine get a share of their own, since small ones would otherwise get none
_SHINING_SHARE = 0.25
_COLOR_POINTS = 8     # of each triangle
_COLORS_AT_ONCE = 65536
# Steps of the two-dimensional low-discrepancy sequence of the plastic number (Roberts 2018)
_PLASTIC = np.array([0.7548776662466927, 0.5698402909980532])


@dataclass(frozen=True)
class Surfels:
    """Samples of the scene's surfaces, evenly by area. Neighbours in the order are neighbours in space.

    Attributes:
        position: (N, 3) float32, metres.
        normal: (N, 3) float32, of the triangle, on the side that sends. Two-sided surfaces have surfels on both sides.
        albedo: (N, 3) float32, diffuse reflectance; 0 in holes.
        emission: (N, 3) float32, W m^-2 sr^-1; 0 in holes.
        area: (N,) float32, square metres.
    """

    position: np.ndarray
    normal: np.ndarray
    albedo: np.ndarray
    emission: np.ndarray
    area: np.ndarray


@dataclass(frozen=True)
class _Part:
    """Triangles of one primitive of one instance: corners (T, 3, 3), their normals times area (T, 3)."""

    primitive: Primitive
    material: Material
    corners: np.ndarray
    normal_area: np.ndarray


def spread_surfels(scene: Scene, origin: np.ndarray, count: int) -> Surfels:
    """Spread `count` surfels over a scene; none if it has no surface.

    Args:
        origin: (3,) the world position that becomes zero.
    """
    parts = [_part(scene, instance.world_from_object, primitive, origin) for instance in scene.instances
             for primitive in scene.meshes[instance.mesh].primitives if len(primitive.indices)]
    shining = [part for part in parts if max(part.material.emission) > 0]
    others = [part for part in parts if max(part.material.emission) <= 0]
    of_shining = round(count * _SHINING_SHARE) if shining and others else (count if shining else 0)
    found = [*_spread(scene, shining, of_shining), *_spread(scene, others, count - of_shining)]
    if not found:
        return Surfels(*(np.zeros((0, 3), np.float32),) * 4, np.zeros(0, np.float32))
    merged = Surfels(*(np.concatenate([getattr(s, f.name) for s in found]) for f in fields(Surfels)))
    order = np.argsort(_morton(merged.position), kind="stable")
    return Surfels(*(getattr(merged, f.name)[order] for f in fields(Surfels)))


def _part(scene: Scene, world_from_object: np.ndarray, primitive: Primitive, origin: np.ndarray) -> _Part:
    points = primitive.positions @ world_from_object[:3, :3].T + (world_from_object[:3, 3] - origin)
    corners = points[primitive.indices]
    normal_area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    if np.linalg.det(world_from_object[:3, :3]) < 0:
        normal_area = -normal_area      # front faces stay front faces
    return _Part(primitive, scene.materials[primitive.material], corners, normal_area)


def _spread(scene: Scene, parts: list[_Part], count: int) -> list[Surfels]:
    """`count` surfels over some parts: systematic samples of the area, one after the other."""
    areas = [np.linalg.norm(part.normal_area, axis=1) * (2 if part.material.double_sided else 1) for part in parts]
    ends = np.cumsum(np.concatenate(areas)) if areas else np.zeros(1)
    total = float(ends[-1])
    if total <= 0 or count <= 0:
        return []
    chosen = np.searchsorted(ends, (np.arange(count) + 0.5) * (total / count), side="right").clip(max=len(ends) - 1)
    place = np.arange(1, count + 1)[:, None] * _PLASTIC % 1.0
    found, first = [], 0
    for part, area in zip(parts, areas):
        mine = slice(*np.searchsorted(chosen, (first, first + len(area))))
        if mine.stop > mine.start:
            found.append(_surfels(scene, part, chosen[mine] - first, place[mine], total / count, mine.start))
        first += len(area)
    return found


def _surfels(scene: Scene, part: _Part, triangle: np.ndarray, place: np.ndarray, area: float,
             number: int) -> Surfels:
    """number: how many surfels were there before: every second one lies on the back of what has two sides."""
    primitive, material = part.primitive, part.material
    weights = _weights(place)
    normal = part.normal_area[triangle]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    if material.double_sided:
        normal[1 - number % 2::2] *= -1
    albedo, emission = _sent(scene, primitive, material, triangle, weights)
    there = np.ones((len(triangle), 1), np.float32)
    if material.alpha_mode != "opaque":
        there[Mask(primitive, material, scene.images).is_hole(triangle, weights)] = 0
    return Surfels(*(np.float32(values) for values in (
        np.einsum("nk,nkc->nc", weights, part.corners[triangle]), normal, albedo * there, emission * there,
        np.full(len(triangle), area))))


def _sent(scene: Scene, primitive: Primitive, material: Material, triangle: np.ndarray, weights: np.ndarray
          ) -> tuple[np.ndarray, np.ndarray]:
    """Diffuse reflectance and emission, (N, 3) each, at barycentric weights (N, 3) of triangles (N,)."""
    uv = np.einsum("nk,nkst->nst", weights, primitive.texcoords[primitive.indices[triangle]])
    base = np.broadcast_to(np.float32(material.base_color[:3]), (len(triangle), 3))
    if primitive.colors is not None:
        base = base * np.einsum("nk,nkc->nc", weights, primitive.colors[primitive.indices[triangle], :3])
    if (ref := material.base_color_texture) is not None:
        base = base * linear_from_srgb(texels_of(scene.images, ref, uv)[:, :3])
    metallic = np.full((len(triangle), 1), material.metallic)
    if (ref := material.metallic_roughness_texture) is not None:
        metallic = metallic * texels_of(scene.images, ref, uv)[:, 2:3] / 255.0
    emission = np.broadcast_to(np.float32(material.emission), (len(triangle), 3))
    if (ref := material.emission_texture) is not None:
        emission = emission * linear_from_srgb(texels_of(scene.images, ref, uv)[:, :3])
    return np.clip(base, 0, 1) * (1 - metallic), emission


@dataclass(frozen=True)
class TriangleColors:
    """What triangles send on, as means over each; in the order of `SceneTriangles`, solid ones first.

    Attributes:
        albedo, emission: (T, 3) float32, as of `Surfels`; holes do not count.
        double_sided: (T,) bool.
    """

    albedo: np.ndarray
    emission: np.ndarray
    double_sided: np.ndarray


def triangle_colors(scene: Scene) -> TriangleColors:
    """The colours of all triangles of all instances."""
    known: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
    parts: dict[bool, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {True: [], False: []}
    for instance in scene.instances:
        for at, primitive in enumerate(scene.meshes[instance.mesh].primitives):
            material = scene.materials[primitive.material]
            key = (instance.mesh, at)
            if key not in known:
                known[key] = _mean_colors(scene, primitive, material)
            parts[material.alpha_mode == "opaque"].append(
                (*known[key], np.full(len(primitive.indices), material.double_sided)))
    every = [*parts[True], *parts[False]]
    none = np.zeros((0, 3), np.float32)
    return TriangleColors(*(np.concatenate([empty, *(part[at] for part in every)])
                            for at, empty in enumerate((none, none, np.zeros(0, bool)))))


def _mean_colors(scene: Scene, primitive: Primitive, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Means over each triangle; a part of the triangles at a time, since each point takes a hundred bytes."""
    count = len(primitive.indices)
    parts = [_some_mean_colors(scene, primitive, material, np.arange(first, min(first + _COLORS_AT_ONCE, count)))
             for first in range(0, max(count, 1), _COLORS_AT_ONCE)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _some_mean_colors(scene: Scene, primitive: Primitive, material: Material, chosen: np.ndarray
                      ) -> tuple[np.ndarray, np.ndarray]:
    triangle = np.repeat(chosen, _COLOR_POINTS)
    weights = _weights((triangle * _COLOR_POINTS + np.tile(np.arange(1, _COLOR_POINTS + 1), len(chosen)))[:, None]
                       * _PLASTIC % 1.0)
    albedo, emission = _sent(scene, primitive, material, triangle, weights)
    there = np.ones(len(triangle))
    if material.alpha_mode != "opaque":
        there = 1e-6 + ~Mask(primitive, material, scene.images).is_hole(triangle, weights)
    share = (there / there.reshape(-1, _COLOR_POINTS).sum(1).repeat(_COLOR_POINTS))[:, None]
    return tuple(np.float32((values * share).reshape(-1, _COLOR_POINTS, 3).sum(1)) for values in (albedo, emission))


def _weights(place: np.ndarray) -> np.ndarray:
    """(N, 3) barycentric weights of points (N, 2) of the unit square (Turk 1990)."""
    root = np.sqrt(place[:, 0])
    return np.stack([1 - root, root * (1 - place[:, 1]), root * place[:, 1]], 1)


def _morton(position: np.ndarray) -> np.ndarray:
    """(N,) place on the Z-order curve through the bounding box, 10 bits an axis."""
    low = position.min(0)
    cell = ((position - low) / max(float(np.ptp(position, axis=0).max()), 1e-30) * 1023).astype(np.uint64)
    code = np.zeros(len(position), np.uint64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code
