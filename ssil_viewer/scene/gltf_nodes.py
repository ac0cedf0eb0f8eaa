"""The node hierarchy of a glTF asset: world transforms, instances, cameras and lights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.gltf_accessors import read_accessor
from ssil_viewer.scene.gltf_document import (
    Document,
    extension,
    index_at,
    list_at,
    number_at,
    object_at,
    text_at,
    vector_at,
)
from ssil_viewer.scene.model import Camera, Light

ORTHOGRAPHIC_FOV = math.radians(10.0)
"""Vertical angle of the perspective camera that stands in for an orthographic one: small, so that lines that are
parallel stay nearly so, and large enough for the depth buffer."""


MIN_CONE = math.radians(0.1)
"""The narrowest spot light in radians; the penumbra is at least half as wide, so that no division is by zero."""

MAX_INSTANCES = 1_000_000
"""Instances that one node may ask for; a few bytes of a file can claim any number."""

MAX_BACKGROUND = 65000.0
"""Brightest backdrop, W m^-2 sr^-1: render targets end at 65408 (a shared exponent) and 65504 (half floats)."""

_TRANSFORM_KEYS = {"matrix", "translation", "rotation", "scale"}


@dataclass(frozen=True, eq=False)
class PlacedNode:
    """A node of the active scene.

    Attributes:
        index: Index into "nodes".
        json: The node.
        world_from_node: (4, 4) float64.
    """

    index: int
    json: dict
    world_from_node: np.ndarray

    @property
    def name(self) -> str:
        return _label(self.json, self.index)


def _label(node: dict, index: int) -> str:
    return text_at(node, "name") or f"node {index}"


def place_nodes(document: Document) -> tuple[list[PlacedNode], dict[int, np.ndarray]]:
    """Walks the hierarchy, without recursion, since chains may be thousands long.

    Returns:
        The nodes of the active scene, parents first, and the (4, 4) world transform of every node of the file
        that has one: joints may stand outside of the active scene.
    """
    parentless = _parentless(document)
    locals_ = _local_transforms(document)
    worlds: dict[int, np.ndarray] = {}
    placed = _walk(document, _scene_roots(document, parentless), locals_, worlds)
    _walk(document, [index for index in parentless if index not in worlds], locals_, worlds)
    return placed, worlds


def _parentless(document: Document) -> list[int]:
    """Indices of the nodes that are nobody's child."""
    children: set[int] = set()
    nodes = list_at(document.json, "nodes")
    for node in nodes:
        listed = node.get("children") if isinstance(node, dict) else None
        if isinstance(listed, list):
            children.update(child for child in listed if isinstance(child, int))
    return [index for index in range(len(nodes)) if index not in children]


def _scene_roots(document: Document, parentless: list[int]) -> list:
    """The root nodes of the active scene; all nodes without parent when the file has no scenes."""
    scenes = list_at(document.json, "scenes")
    if not scenes:
        return parentless
    wanted, active = index_at(document.json, "scene") or 0, _active_scene(document)
    if wanted != active:
        document.warnings.add("the active scene does not exist, the first is shown", f"scene {wanted}")
    if len(scenes) > 1:
        document.warnings.add(f"only one of the file's {len(scenes)} scenes is shown", f"scene {active}")
    return list_at(document.entry("scenes", active), "nodes")


def _active_scene(document: Document) -> int:
    active = index_at(document.json, "scene") or 0
    return active if active < len(list_at(document.json, "scenes")) else 0


def read_background(document: Document) -> tuple[float, float, float]:
    """Radiance of the backdrop, `extras.background` of the active scene: our own convention. Black when absent."""
    black = (0.0, 0.0, 0.0)
    if not list_at(document.json, "scenes"):
        return black
    extras = document.entry("scenes", _active_scene(document)).get("extras")
    if not isinstance(extras, dict):    # anything may stand there, and it means nothing to us
        return black
    try:
        found = vector_at(extras, "background", black)
    except Malformed:
        found = (-1.0,)
    if not all(0.0 <= value <= MAX_BACKGROUND for value in found):
        shown = f"{MAX_BACKGROUND:g}"
        document.warnings.note(f"the background is not three numbers from 0 to {shown} and was left out")
        return black
    return found


def _walk(document: Document, roots: list, locals_: np.ndarray, worlds: dict[int, np.ndarray]) -> list[PlacedNode]:
    """Places the nodes below `roots`; extends `worlds`. Each node is placed once, so that cycles end."""
    usable = np.all(np.isfinite(locals_), axis=(1, 2))
    placed = []
    stack = [(root, None) for root in reversed(roots)]
    while stack:
        index, parent = stack.pop()
        try:
            if isinstance(index, bool) or not isinstance(index, int):
                raise Malformed(f"{index!r} is not a node")
            entry = document.entry("nodes", index)
            if index in worlds:
                raise Malformed(f"nodes[{index}] has several parents or is its own descendant")
            if not usable[index]:
                raise Malformed(f"nodes[{index}] has a broken transform")
            children = list_at(entry, "children")
        except Malformed as problem:
            document.warnings.add("a node was skipped", str(problem))
            continue
        world = locals_[index] if parent is None else parent @ locals_[index]
        worlds[index] = world
        placed.append(PlacedNode(index, entry, world))
        stack.extend((child, world) for child in reversed(children))
    return placed


def _local_transforms(document: Document) -> np.ndarray:
    """The parent_from_node matrices of all nodes, (N, 4, 4) float64, NaN where a node's numbers are none.

    All at once, since files with tens of thousands of nodes are common.
    """
    nodes = list_at(document.json, "nodes")
    translation = np.zeros((len(nodes), 3))
    rotation = np.tile((0.0, 0.0, 0.0, 1.0), (len(nodes), 1))
    scale = np.ones((len(nodes), 3))
    matrices: dict[int, np.ndarray] = {}
    for index, node in enumerate(nodes):
        if not isinstance(node, dict) or node.keys().isdisjoint(_TRANSFORM_KEYS):
            continue
        try:
            if "matrix" in node:
                matrices[index] = np.array(vector_at(node, "matrix", (0.0,) * 16)).reshape(4, 4).T
                if len(node.keys() & _TRANSFORM_KEYS) > 1:
                    document.warnings.add(
                        "a node has a matrix and other transforms too, which are ignored", _label(node, index)
                    )
                continue
            translation[index] = vector_at(node, "translation", (0.0, 0.0, 0.0))
            rotation[index] = vector_at(node, "rotation", (0.0, 0.0, 0.0, 1.0))
            scale[index] = vector_at(node, "scale", (1.0, 1.0, 1.0))
        except Malformed:
            translation[index] = np.nan
    length = np.linalg.norm(rotation, axis=1)
    for index in np.flatnonzero(~(np.abs(length - 1.0) < 0.01)):
        document.warnings.add("a rotation is no unit quaternion and was normalised", _label(nodes[index], int(index)))
    locals_ = compose(translation, rotation, scale)
    for index, matrix in matrices.items():
        locals_[index, :3] = matrix[:3]  # the last row of an affine transform is fixed
    return locals_


def compose(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Matrices T R S from (N, 3) translations, (N, 4) quaternions xyzw and (N, 3) scales: (N, 4, 4) float64.

    Quaternions are normalised; a zero one is no rotation.
    """
    length = np.linalg.norm(rotation, axis=1, keepdims=True)
    x, y, z, w = np.where(length > 0.0, rotation / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 0.0, 1.0)).T
    matrices = np.zeros((len(translation), 4, 4))
    matrices[:, 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    matrices[:, 0, 1] = 2.0 * (x * y - z * w)
    matrices[:, 0, 2] = 2.0 * (x * z + y * w)
    matrices[:, 1, 0] = 2.0 * (x * y + z * w)
    matrices[:, 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    matrices[:, 1, 2] = 2.0 * (y * z - x * w)
    matrices[:, 2, 0] = 2.0 * (x * z - y * w)
    matrices[:, 2, 1] = 2.0 * (y * z + x * w)
    matrices[:, 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    matrices[:, :3, :3] *= scale[:, None, :]
    matrices[:, :3, 3] = translation
    matrices[:, 3, 3] = 1.0
    return matrices


def instance_transforms(document: Document, node: PlacedNode) -> np.ndarray:
    """World transforms at which a node's mesh is drawn, (N, 4, 4): one, or those of EXT_mesh_gpu_instancing.

    Raises:
        Malformed: The instance attributes cannot be read.
    """
    instancing = extension(node.json, "EXT_mesh_gpu_instancing")
    if instancing is None:
        return node.world_from_node[None]
    attributes = object_at(instancing, "attributes")
    arrays = {}
    for key, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3")):
        if key in attributes:
            arrays[key] = read_accessor(document, index_at(attributes, key), (kind,)).astype(np.float64)
    counts = {len(array) for array in arrays.values()}
    if len(counts) != 1:
        raise Malformed("the instance attributes are absent or differ in length")
    count = counts.pop()
    if count > MAX_INSTANCES:
        raise Malformed(f"{count} instances are too many")
    locals_ = compose(
        arrays.get("TRANSLATION", np.zeros((count, 3))),
        arrays.get("ROTATION", np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))),
        arrays.get("SCALE", np.ones((count, 3))),
    )
    return node.world_from_node @ locals_


def _axis(matrix: np.ndarray, column: int) -> np.ndarray:
    """A column of a transform as a unit vector.

    Raises:
        Malformed: The transform flattens it.
    """
    vector = matrix[:3, column]
    length = np.linalg.norm(vector)
    if not length > 0.0:
        raise Malformed("its transform has no direction")
    return vector / length


def read_cameras(document: Document, nodes: list[PlacedNode], center: np.ndarray) -> tuple[Camera, ...]:
    """The cameras of the active scene, in node order.

    Args:
        document: The asset.
        nodes: The placed nodes.
        center: (3,) middle of the scene: cameras get the point nearest to it on their line of sight as target.
    """
    cameras = []
    for node in nodes:
        if "camera" not in node.json:
            continue
        try:
            cameras.append(_camera(document, node, center))
        except Malformed as problem:
            document.warnings.add("a camera was skipped", f"{node.name}: {problem}")
    return tuple(cameras)


def _camera(document: Document, node: PlacedNode, center: np.ndarray) -> Camera:
    entry = document.entry("cameras", index_at(node.json, "camera"))
    name = text_at(node.json, "name") or text_at(entry, "name") or f"camera {node.index}"
    eye = node.world_from_node[:3, 3]
    forward = -_axis(node.world_from_node, 2)
    up = _axis(node.world_from_node, 1)
    distance = float((center - eye) @ forward)
    kind = entry.get("type")
    near: float | None = None
    if kind == "perspective":
        lens = object_at(entry, kind)
        fov = number_at(lens, "yfov", math.radians(45.0))
        if not 0.0 < fov < math.pi:
            raise Malformed("its field of view is out of range")
        near = number_at(lens, "znear", 0.0)
        near = near if near > 0.0 else None
        if "aspectRatio" in lens:
            document.warnings.add("the aspect ratio of a camera is ignored, the image has its own", name)
    elif kind == "orthographic":
        document.warnings.add("an orthographic camera is replaced by a distant perspective one", name)
        lens = object_at(entry, kind)
        half_height = abs(number_at(lens, "ymag", 1.0)) or 1.0
        fov = ORTHOGRAPHIC_FOV
        on_axis = eye + forward * max(distance, 0.0)
        distance = half_height / math.tan(fov / 2.0)
        eye = on_axis - forward * distance
    else:
        raise Malformed(f"its type {kind!r} is unknown")
    if "zfar" in lens:
        document.warnings.add("the far plane (zfar) of a camera is ignored, nothing is cut off", name)
    target = eye + forward * (distance if distance > 0.0 else 1.0)
    return Camera(name, tuple(eye.tolist()), tuple(target.tolist()), tuple(up.tolist()), fov, near)


def read_lights(document: Document, nodes: list[PlacedNode]) -> tuple[Light, ...]:
    """The KHR_lights_punctual lights of the active scene, in node order."""
    lights = []
    for node in nodes:
        try:
            reference = extension(node.json, "KHR_lights_punctual")
            if reference is not None:
                lights.append(_light(document, node, index_at(reference, "light")))
        except (Malformed, UserError) as problem:   # the second is raised by the light itself
            document.warnings.add("a light was skipped", f"{node.name}: {problem}")
    return tuple(lights)


def _light(document: Document, node: PlacedNode, index: int | None) -> Light:
    entries = list_at(extension(document.json, "KHR_lights_punctual") or {}, "lights")
    if index is None or index >= len(entries) or not isinstance(entries[index], dict):
        raise Malformed(f"light {index} does not exist")
    entry = entries[index]
    kind = entry.get("type")
    if kind not in ("directional", "point", "spot"):
        raise Malformed(f"its type {kind!r} is unknown")
    intensity = number_at(entry, "intensity", 1.0)
    color = vector_at(entry, "color", (1.0, 1.0, 1.0))
    reach = number_at(entry, "range", math.inf)
    spot = object_at(entry, "spot")
    inner = number_at(spot, "innerConeAngle", 0.0)
    outer = number_at(spot, "outerConeAngle", math.pi / 4.0)
    if intensity < 0.0 or min(color) < 0.0 or reach <= 0.0:
        raise Malformed("its intensity, colour or range is negative")
    if kind == "spot" and not 0.0 <= inner <= outer <= math.pi / 2.0 + 1e-6:
        document.warnings.add("cone angles out of range were clamped", text_at(node.json, "name") or f"light {index}")
    outer = min(max(outer, MIN_CONE), math.pi / 2.0)
    inner = min(max(inner, 0.0), outer - MIN_CONE / 2.0)  # exporters write equal angles for a hard edge
    return Light(
        kind=kind,
        name=text_at(node.json, "name") or text_at(entry, "name") or f"light {index}",
        color=color,
        intensity=intensity,
        position=tuple(node.world_from_node[:3, 3].tolist()),
        direction=(0.0, -1.0, 0.0) if kind == "point" else tuple((-_axis(node.world_from_node, 2)).tolist()),
        range=reach,
        inner_cone=inner,
        outer_cone=outer,
    )
