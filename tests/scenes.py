"""Small scenes made of rectangles, for tests with known answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ssil_viewer.scene.model import Camera, Instance, Light, Material, Mesh, Primitive, Scene

CORNELL_CAMERA = Camera(eye=(0.0, 0.0, 3.2), vertical_fov=0.8)


def rectangle(corner, edge_u, edge_v, material: int = 0, steps: int = 1) -> Primitive:
    """A parallelogram whose front face looks along edge_u x edge_v."""
    corner, edge_u, edge_v = (np.asarray(v, np.float64) for v in (corner, edge_u, edge_v))
    grid = np.linspace(0, 1, steps + 1)
    v, u = np.meshgrid(grid, grid, indexing="ij")
    positions = corner + u.reshape(-1, 1) * edge_u + v.reshape(-1, 1) * edge_v
    normal = np.cross(edge_u, edge_v)
    normal /= np.linalg.norm(normal)
    at = np.arange(steps)
    row, column = np.meshgrid(at, at, indexing="ij")
    a = (row * (steps + 1) + column).ravel()
    b, c, d = a + 1, a + steps + 2, a + steps + 1
    indices = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    texcoords = np.zeros((len(positions), 2, 2), np.float32)
    texcoords[:, 0, 0], texcoords[:, 0, 1] = u.ravel(), v.ravel()
    return Primitive(positions.astype(np.float32), np.tile(normal, (len(positions), 1)).astype(np.float32), None,
                     texcoords, None, indices.astype(np.uint32), material)


def polygon(corners, material: int = 0) -> Primitive:
    """A convex flat polygon as a fan; its front face looks along the turn of its corners (right-hand rule)."""
    corners = np.asarray(corners, np.float64)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    at = np.arange(1, len(corners) - 1)
    return Primitive(corners.astype(np.float32), np.tile(normal, (len(corners), 1)).astype(np.float32), None,
                     np.zeros((len(corners), 2, 2), np.float32), None,
                     np.stack([np.zeros_like(at), at, at + 1], 1).astype(np.uint32), material)


def box(center, size, material: int = 0, inward: bool = False) -> tuple[Primitive, ...]:
    """Six faces; `inward` makes a room."""
    c, s = np.asarray(center, np.float64), np.asarray(size, np.float64)
    faces = []
    for axis in range(3):
        for sign in (-1, 1):
            u, v = np.zeros(3), np.zeros(3)
            u[(axis + 1) % 3], v[(axis + 2) % 3] = s[(axis + 1) % 3], s[(axis + 2) % 3]
            if (sign < 0) != inward:
                u, v = v, u
            middle = c.copy()
            middle[axis] += sign * s[axis] / 2
            faces.append(rectangle(middle - (u + v) / 2, u, v, material))
    return tuple(faces)


def sphere(rings: int, segments: int, radius: float = 1.0) -> Primitive:
    """A sphere about the origin with smooth normals, coarse enough to have facets."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments + 1),
                                indexing="ij")
    normals = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], -1)
    normals = normals.reshape(-1, 3)
    corner = (np.arange(rings)[:, None] * (segments + 1) + np.arange(segments)).reshape(-1, 1)
    indices = np.concatenate([corner + (0, 1, segments + 2), corner + (0, segments + 2, segments + 1)])
    return replace(rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), positions=(radius * normals).astype(np.float32),
                   normals=normals.astype(np.float32), texcoords=np.zeros((len(normals), 2, 2), np.float32),
                   indices=indices.astype(np.uint32))


def scene(primitives, materials, lights: tuple[Light, ...] = (), name: str = "test") -> Scene:
    """One mesh at the origin."""
    return Scene(name, meshes=(Mesh("all", tuple(primitives)),), instances=(Instance("all", 0, np.eye(4)),),
                 materials=tuple(materials), lights=tuple(lights))


def cornell() -> Scene:
    """A box of 2 m with red and green walls, two blocks and a point light; the camera looks along -Z."""
    white, red, green = (Material(name=n, base_color=(*c, 1.0), specular=0.0) for n, c in (
        ("white", (0.73, 0.73, 0.73)), ("red", (0.63, 0.065, 0.05)), ("green", (0.14, 0.45, 0.09))))
    walls = [rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2)), rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
             rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0)), rectangle((-1, -1, 1), (0, 0, -2), (0, 2, 0), 1),
             rectangle((1, -1, -1), (0, 0, 2), (0, 2, 0), 2)]
    blocks = [*box((-0.35, -0.4, -0.35), (0.6, 1.2, 0.6)), *box((0.4, -0.7, 0.3), (0.6, 0.6, 0.6))]
    return scene(walls + blocks, (white, red, green), (Light("point", intensity=3.0, position=(0.0, 0.9, 0.0)),),
                 "cornell")


def half_metal_cornell() -> Scene:
    """The same box, all of it half a metal, which reflects as well as it scatters."""
    room = cornell()
    return replace(room, materials=tuple(replace(m, metallic=0.5, roughness=0.4) for m in room.materials))
