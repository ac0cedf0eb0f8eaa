"""Loads glTF 2.0 (.gltf and .glb).

The work is divided: gltf_document (container, buffers), gltf_accessors (arrays), gltf_materials (materials,
textures, images), gltf_meshes with gltf_deform and gltf_draco (geometry), gltf_nodes (hierarchy, cameras, lights).
What the program cannot show is named in `Scene.warnings`; what is broken is left out, with a warning, as long as
something remains.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.gltf_document import Document, extension, list_at, read_document, text_at
from ssil_viewer.scene.gltf_materials import MaterialReader
from ssil_viewer.scene.gltf_meshes import MeshReader
from ssil_viewer.scene.gltf_nodes import (
    PlacedNode,
    instance_transforms,
    place_nodes,
    read_background,
    read_cameras,
    read_lights,
)
from ssil_viewer.scene.model import Instance, Material, Mesh, Scene
from ssil_viewer.scene.transforms import made_invertible
from ssil_viewer.scene.warning_list import WarningList

# Extensions that are honoured, or whose readers report by themselves what they cannot do.
_KNOWN_EXTENSIONS = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "MSFT_texture_dds",
}


def load_gltf(path: Path, name: str) -> Scene:
    """Loads a glTF file.

    Args:
        path: The .gltf or .glb file.
        name: For `Scene.name`.

    Raises:
        UserError: It is not glTF 2.0, or holds no geometry that can be read.
    """
    warnings = WarningList()
    document = read_document(path, warnings)
    try:
        return _load(document, name)
    except Malformed as problem:
        raise UserError(f"the glTF file is broken: {problem}", str(path), "export it again") from problem


def _load(document: Document, name: str) -> Scene:
    warnings = document.warnings
    materials = MaterialReader(document)
    nodes, worlds = place_nodes(document)
    meshes = MeshReader(document, materials, worlds)
    instances = _read_instances(document, nodes, meshes)
    if not instances:
        # A library of meshes that no scene places is still worth a look.
        loose = [PlacedNode(i, {"mesh": i}, np.eye(4)) for i in range(len(list_at(document.json, "meshes")))]
        instances = _read_instances(document, loose, meshes) if not any("mesh" in n.json for n in nodes) else []
        if instances:
            warnings.add("no node places a mesh, so all meshes are shown at the origin")
    if not instances:
        reasons = warnings.sentences()
        raise UserError("no geometry to show", str(document.path), reasons[0] if reasons else "it has no triangles")
    finished_materials, images = materials.finish()
    lights = read_lights(document, nodes)
    placed = Scene(name, tuple(meshes.meshes), tuple(instances))
    low, high = placed.bounds()
    cameras = read_cameras(document, nodes, (low + high) / 2.0)
    background = read_background(document)
    animations = _animation_names(document)
    _report_extensions(document)
    return Scene(
        name=name,
        meshes=tuple(_without_spare_tangents(mesh, finished_materials) for mesh in placed.meshes),
        instances=placed.instances,
        materials=finished_materials,
        images=images,
        lights=lights,
        cameras=cameras,
        background=background,
        animations=animations,
        warnings=warnings.sentences(),
    )


def _read_instances(document: Document, nodes: list[PlacedNode], meshes: MeshReader) -> list[Instance]:
    """The instances of all nodes that have a mesh."""
    names: list[str] = []
    meshes_placed: list[int] = []
    transforms = [np.empty((0, 4, 4))]
    for node in nodes:
        if "mesh" not in node.json:
            if extension(node.json, "EXT_mesh_gpu_instancing") is not None:
                document.warnings.add("instances of nothing were ignored", node.name)
            continue
        try:
            mesh, in_world_space = meshes.place(node)
            if mesh is None:
                continue
            placed = np.eye(4)[None] if in_world_space else instance_transforms(document, node)
        except Malformed as problem:
            document.warnings.add("a node's mesh was skipped", f"{node.name}: {problem}")
            continue
        transforms.append(placed)
        names += [node.name] * len(placed)
        meshes_placed += [mesh] * len(placed)
    solid, visible = made_invertible(np.concatenate(transforms))
    for index in np.flatnonzero(~visible):
        document.warnings.add("an instance that is scaled to nothing or beyond all bounds is not drawn", names[index])
    return [
        Instance(name, mesh, transform)
        for name, mesh, transform, shown in zip(names, meshes_placed, solid, visible, strict=True)
        if shown
    ]


def _without_spare_tangents(mesh: Mesh, materials: tuple[Material, ...]) -> Mesh:
    """The mesh without the tangents for normal maps that turned out to be unreadable."""
    if all(p.tangents is None or materials[p.material].normal_texture is not None for p in mesh.primitives):
        return mesh
    primitives = (p if materials[p.material].normal_texture else replace(p, tangents=None) for p in mesh.primitives)
    return replace(mesh, primitives=tuple(primitives))


def _animation_names(document: Document) -> tuple[str, ...]:
    names = []
    for index, entry in enumerate(list_at(document.json, "animations")):
        names.append((text_at(entry, "name") if isinstance(entry, dict) else "") or f"animation {index}")
        document.warnings.add("animations are not played", names[-1])
    return tuple(names)


def _report_extensions(document: Document) -> None:
    """Names the extensions of the file that nothing here knows."""
    for key in ("extensionsUsed", "extensionsRequired"):
        for name in list_at(document.json, key):
            if isinstance(name, str) and name not in _KNOWN_EXTENSIONS:
                document.warnings.note(document.unsupported(name))
