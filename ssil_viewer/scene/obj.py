"""Loads Wavefront OBJ files with their MTL materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.scene.colors import srgb_to_linear
from ssil_viewer.scene.geometry import VertexArrays, build_primitive, corner_angles, face_normals, sum_per_group
from ssil_viewer.scene.model import Instance, Material, Mesh, Primitive, Scene
from ssil_viewer.scene.obj_materials import MtlConverter, read_libraries
from ssil_viewer.scene.obj_text import ObjText, read_obj_text
from ssil_viewer.scene.polygons import triangulate
from ssil_viewer.scene.transforms import origin_near
from ssil_viewer.scene.warning_list import WarningList


def load_obj(path: Path, name: str) -> Scene:
    """Loads an OBJ file: a mesh for each object or group, a primitive for each of its materials.

    Args:
        path: The file.
        name: For `Scene.name`.

    Raises:
        UserError: It cannot be read, or holds no faces.
    """
    warnings = WarningList()
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"the scene cannot be read ({error.strerror})", str(path)) from error
    text = read_obj_text(data, warnings)
    used = list(dict.fromkeys(text.state_list[index].material for index in text.states.tolist()))
    libraries = read_libraries(path.parent, text.libraries, warnings)
    for missing in used:
        if missing is not None and missing not in libraries:
            warnings.add("a material is not defined and is replaced by the default", missing)
    sources = [libraries.get(material) if material is not None else None for material in used]
    materials, images = MtlConverter(path.parent, sources, warnings).convert()

    translation = origin_near(text.positions)
    meshes = _build_meshes(text, translation, {n: i for i, n in enumerate(used)}, materials, warnings)
    if not meshes:
        reasons = warnings.sentences()
        raise UserError("no geometry to show", str(path), reasons[0] if reasons else "it has no faces")
    world_from_object = np.eye(4)
    world_from_object[:3, 3] = translation
    return Scene(
        name=name,
        meshes=tuple(meshes),
        instances=tuple(Instance(mesh.name, index, world_from_object) for index, mesh in enumerate(meshes)),
        materials=materials,
        images=images,
        warnings=warnings.sentences(),
    )


def _build_meshes(
    text: ObjText,
    translation: np.ndarray,
    places: dict[str | None, int],
    materials: tuple[Material, ...],
    warnings: WarningList,
) -> list[Mesh]:
    """Groups the faces by group and material and builds a primitive of each."""
    positions = text.positions - translation
    triangles, owner = _triangles(text, positions, warnings)
    if not len(triangles):
        return []
    smoothing = np.array([state.smoothing for state in text.state_list])[text.states[owner]]
    corners, normals = _with_normals(text, positions, text.corners[triangles], smoothing)

    groups = {group: index for index, group in enumerate(dict.fromkeys(state.group for state in text.state_list))}
    batch_of_state = np.array([groups[s.group] * len(places) + places[s.material] for s in text.state_list])
    batch = batch_of_state[text.states[owner]]
    order = np.argsort(batch, kind="stable")
    bounds = np.flatnonzero(np.diff(batch[order])) + 1
    names = list(groups)
    primitives: dict[str, list[Primitive]] = {}
    for chosen in np.split(order, bounds):
        group, material = divmod(int(batch[chosen[0]]), len(places))
        label = names[group] or "mesh"
        arrays = _vertex_arrays(text, positions, normals, corners[chosen])
        primitive = build_primitive(arrays, material, materials[material], label, warnings)
        if primitive is not None:
            primitives.setdefault(label, []).append(primitive)
    return [Mesh(label, tuple(parts)) for label, parts in primitives.items()]


def _triangles(text: ObjText, positions: np.ndarray, warnings: WarningList) -> tuple[np.ndarray, np.ndarray]:
    """All faces as triangles: (T, 3) indices into `text.corners`, and (T,) their faces.

    Faces with corners that do not exist are dropped; so are references to texture coordinates and normals that
    do not exist.
    """
    starts = np.cumsum(text.sizes) - text.sizes
    vertex = text.corners[:, 0]
    outside = (vertex < 0) | (vertex >= len(positions))
    broken = np.zeros(len(text.sizes), dtype=bool)
    broken[np.repeat(np.arange(len(text.sizes)), text.sizes)[outside]] = True
    if broken.any():
        warnings.add("faces with vertices that do not exist were dropped", count=int(broken.sum()))
    for slot, table in ((1, text.texcoords), (2, text.normals)):
        wild = text.corners[:, slot] >= len(table)
        if wild.any():
            warnings.add("references to texture coordinates or normals that do not exist were ignored")
            text.corners[wild, slot] = -1
    good = np.flatnonzero(~broken)
    points = positions[np.where(outside, 0, vertex)] if len(positions) else np.zeros((len(vertex), 3))
    triangles, owner = triangulate(points, starts[good], text.sizes[good])
    return triangles, good[owner]


def _with_normals(
    text: ObjText, positions: np.ndarray, corners: np.ndarray, smoothing: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gives every triangle a normal at each corner.

    Args:
        text: For the file's normals.
        positions: (V, 3).
        corners: (T, 3, 3) indices of the triangles' corners into positions, texcoords and normals.
        smoothing: (T,) smoothing groups: triangles of the same group, other than 0, share normals at a vertex.

    Returns:
        The corners with no normal missing, and the (N, 3) table of normals: the file's, then the computed ones.
    """
    bare = np.any(corners[:, :, 2] < 0, axis=1)
    if not bare.any():
        return corners, text.normals
    corners = corners.copy()
    faces = face_normals(positions, corners[bare, :, 0])
    tables = [text.normals, faces]
    flat_index = len(text.normals) + np.arange(len(faces))
    corners[bare, :, 2] = flat_index[:, None]

    smooth = bare & (smoothing > 0)
    if smooth.any():
        vertices = corners[smooth, :, 0]
        keys = vertices + len(positions) * smoothing[smooth].astype(np.int64)[:, None]
        unique, group = np.unique(keys, return_inverse=True)
        group = group.reshape(-1)
        weighted = face_normals(positions, vertices)[:, None] * corner_angles(positions, vertices)[..., None]
        corners[smooth, :, 2] = len(text.normals) + len(faces) + group.reshape(-1, 3)
        tables.append(sum_per_group(group, weighted.reshape(-1, 3), len(unique)))
    return corners, np.concatenate(tables)


def _vertex_arrays(text: ObjText, positions: np.ndarray, normals: np.ndarray, corners: np.ndarray) -> VertexArrays:
    """An indexed triangle list from corners (T, 3, 3): equal corners become one vertex."""
    first, inverse = _unique_corners(corners.reshape(-1, 3))
    vertices = corners.reshape(-1, 3)[first]
    texcoords = None
    if np.any(vertices[:, 1] >= 0):
        uv = np.where(vertices[:, 1:2] >= 0, text.texcoords[vertices[:, 1]], 0.0)
        texcoords = np.zeros((len(vertices), 2, 2))
        texcoords[:, 0, 0] = uv[:, 0]
        texcoords[:, 0, 1] = 1.0 - uv[:, 1]
    colors = None
    if text.colors is not None:
        colors = np.ones((len(vertices), 4))
        colors[:, :3] = srgb_to_linear(text.colors[vertices[:, 0]])
    return VertexArrays(
        positions[vertices[:, 0]], inverse.reshape(-1, 3), normals[vertices[:, 2]], None, texcoords, colors
    )


def _unique_corners(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Finds equal rows of (C, 3) indices, which are at least -1.

    Returns:
        (U,) a row of each kind, and (C,) the kind of each row.
    """
    _, kind = np.unique(corners[:, 0], return_inverse=True)
    for slot in (1, 2):
        # One integer a row sorts much faster than rows; renumbering in between keeps it within 64 bits.
        key = kind * (int(corners[:, slot].max()) + 2) + corners[:, slot] + 1
        _, first, kind = np.unique(key, return_index=True, return_inverse=True)
    return first, kind
