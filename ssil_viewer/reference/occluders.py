"""What blocks light in a scene, for reference R2: its triangles, through Embree."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.scene.triangles import LIFT, MOST_HOLES, SceneTriangles


class Occluders:
    """The triangles of a scene in a camera's view space, so that single precision is spent around the camera.

    They block from both sides; see `SceneTriangles` for the holes of masked and blended ones.
    """

    def __init__(self, scene: Scene, camera: Camera) -> None:
        eye = np.asarray(camera.eye, np.float64)
        view_from_world = look_along(eye, np.asarray(camera.target, np.float64) - eye, np.asarray(camera.up))
        self._triangles = SceneTriangles.of(scene, view_from_world)
        self._solid, self._masked = _tree(self._triangles.solid), _tree(self._triangles.masked)

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(N,) bool: whether something lies between two points that the camera sees, each (N, 3) in view space."""
        start, end = start * (1 - LIFT), end * (1 - LIFT)
        length = np.linalg.norm(end - start, axis=-1)
        along = ((end - start) / np.maximum(length, 1e-12)[:, None]).astype(np.float32)
        blocked = np.zeros(len(start), bool)
        if self._solid is not None:
            blocked = self._solid[0].run(start.astype(np.float32), along, dists=length.astype(np.float32),
                                         query="OCCLUDED") != -1
        if self._masked is None:
            return blocked
        left, passed = np.flatnonzero(~blocked), np.zeros(len(start))
        for _ in range(MOST_HOLES):
            origin = (start[left] + along[left] * passed[left, None]).astype(np.float32)
            hit = self._masked[0].run(origin, along[left], output=True,
                                      dists=np.maximum(length[left] - passed[left], 0).astype(np.float32))
            met = hit["primID"] >= 0
            left = left[met]
            if not len(left):
                break
            hole = self._holes(hit["primID"][met], hit["u"][met], hit["v"][met])
            blocked[left[~hole]] = True
            # On behind the hole, by as much as the ends are lifted
            passed[left] += hit["tfar"][met] + LIFT * 0.1 * length[left]
            left = left[hole]
        return blocked

    def _holes(self, triangle: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(N,) bool: whether masked triangles have a hole at barycentric coordinates."""
        first, masks = self._triangles.first, self._triangles.masks
        at = np.searchsorted(first, triangle, side="right") - 1
        weights = np.stack([1 - u - v, u, v], -1).astype(np.float64)
        hole = np.zeros(len(triangle), bool)
        for mask in np.unique(at):
            here = at == mask
            hole[here] = masks[mask].is_hole(triangle[here] - first[mask], weights[here])
        return hole


def _tree(triangles: np.ndarray) -> tuple[EmbreeScene, TriangleMesh] | None:
    """Embree's scene, and the mesh that must live as long."""
    if not len(triangles):
        return None
    scene = EmbreeScene(robust=True)
    return scene, TriangleMesh(scene, triangles)
