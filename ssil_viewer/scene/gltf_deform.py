"""Morph targets and skins, evaluated once: the pose in which a file stands when no animation plays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.geometry import VertexArrays
from ssil_viewer.scene.gltf_accessors import read_accessor
from ssil_viewer.scene.gltf_document import Document, index_at, list_at

MAX_INFLUENCE_SETS = 4
"""JOINTS_n and WEIGHTS_n read per primitive, four joints each; more than any exporter writes."""


def apply_morph_targets(
    document: Document, targets: list, weights: tuple[float, ...], arrays: VertexArrays, label: str
) -> VertexArrays:
    """Adds the weighted displacements of POSITION, NORMAL and TANGENT.

    Args:
        document: The asset.
        targets: The primitive's "targets".
        weights: One per target; missing ones are 0.
        arrays: The undeformed arrays.
        label: The mesh's name, for warnings.
    """
    for target, weight in zip(targets, weights, strict=False):
        if weight == 0.0:
            continue
        try:
            if not isinstance(target, dict):
                raise Malformed("a target is not a JSON object")
            arrays = replace(
                arrays,
                positions=_displaced(document, target, "POSITION", arrays.positions, weight),
                normals=_displaced(document, target, "NORMAL", arrays.normals, weight),
                tangents=_displaced(document, target, "TANGENT", arrays.tangents, weight),
            )
        except Malformed as problem:
            document.warnings.add("a morph target was skipped", f"{label}: {problem}")
    return arrays


def _displaced(document: Document, target: dict, key: str, base: np.ndarray | None, weight: float) -> np.ndarray | None:
    """The base array plus the weighted displacement of its first three components, float64."""
    if base is None or key not in target:
        return base
    delta = read_accessor(document, index_at(target, key), ("VEC3",))
    if len(delta) != len(base):
        raise Malformed(f"{key} of a target differs in length")
    moved = base.astype(np.float64)
    moved[:, :3] += weight * delta.astype(np.float64)
    return moved


def joint_matrices(document: Document, skin_index: int, worlds: dict[int, np.ndarray]) -> np.ndarray:
    """The matrices world_from_joint @ joint_from_bind of a skin, (J, 4, 4) float64.

    Raises:
        Malformed: The skin, one of its joints, or its matrices cannot be read.
    """
    skin = document.entry("skins", skin_index)
    joints = list_at(skin, "joints")
    if not joints:
        raise Malformed(f"skins[{skin_index}] has no joints")
    for joint in joints:
        if not isinstance(joint, int) or joint not in worlds:
            raise Malformed(f"skins[{skin_index}] has a joint that is no node")
    world_from_joint = np.stack([worlds[joint] for joint in joints])
    if "inverseBindMatrices" not in skin:
        return world_from_joint
    stored = read_accessor(document, index_at(skin, "inverseBindMatrices"), ("MAT4",))
    if len(stored) < len(joints):
        raise Malformed(f"skins[{skin_index}] has too few inverse bind matrices")
    joint_from_bind = stored[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    return world_from_joint @ joint_from_bind


def apply_skin(
    document: Document, attributes: dict[str, np.ndarray], matrices: np.ndarray, arrays: VertexArrays, label: str
) -> VertexArrays:
    """Moves the vertices into world space with the weighted mean of their joints' matrices.

    Args:
        document: For its warnings.
        attributes: Decoded JOINTS_n (V, 4) and WEIGHTS_n (V, 4).
        matrices: (J, 4, 4) from `joint_matrices`.
        arrays: In the space of the bind pose.
        label: The mesh's name, for warnings.
    """
    count = len(arrays.positions)
    blended = np.zeros((count, 4, 4))
    total = np.zeros(count)
    for number in range(MAX_INFLUENCE_SETS):
        joints, weights = attributes.get(f"JOINTS_{number}"), attributes.get(f"WEIGHTS_{number}")
        if joints is None or weights is None:
            break
        weights = np.nan_to_num(weights.astype(np.float64), posinf=0.0, neginf=0.0)
        outside = (joints >= len(matrices)) & (weights != 0.0)
        if outside.any():
            document.warnings.add("weights of joints that do not exist were dropped", label, int(outside.sum()))
        weights = np.where(outside, 0.0, weights)
        joints = np.minimum(joints, len(matrices) - 1).astype(np.int64)
        for corner in range(4):
            blended += weights[:, corner, None, None] * matrices[joints[:, corner]]
        total += weights.sum(axis=1)
    # Weights are stored with few bits: they need not add up to one. A vertex without any follows the first joint.
    free = ~(total > 0.0)
    blended[free] = matrices[0]
    blended[~free] /= total[~free, None, None]
    return transformed(arrays, blended)


def transformed(arrays: VertexArrays, matrices: np.ndarray) -> VertexArrays:
    """The arrays moved by one (4, 4) matrix or by one for each vertex, (V, 4, 4)."""
    matrices = np.broadcast_to(matrices, (len(arrays.positions), 4, 4))
    linear = matrices[:, :3, :3]
    positions = np.einsum("vij,vj->vi", linear, arrays.positions.astype(np.float64)) + matrices[:, :3, 3]
    normals, tangents = arrays.normals, arrays.tangents
    sign = np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)
    if normals is not None:
        # Cofactors: the inverse transpose times the determinant, which also exists for flattening transforms.
        cofactors = np.stack([np.cross(linear[:, (i + 1) % 3], linear[:, (i + 2) % 3]) for i in range(3)], axis=1)
        normals = np.einsum("vij,vj->vi", cofactors, normals.astype(np.float64)) * sign[:, None]
    if tangents is not None:
        moved = np.einsum("vij,vj->vi", linear, tangents[:, :3].astype(np.float64))
        tangents = np.concatenate([moved, tangents[:, 3:] * sign[:, None]], axis=1)
    return replace(arrays, positions=positions, normals=normals, tangents=tangents)
