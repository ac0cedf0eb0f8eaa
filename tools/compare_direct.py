"""Compares direct light with the path tracer Mitsuba 3 on Lambertian scenes.

    pip install mitsuba && python tools/compare_direct.py [--size 640x360] [--samples 16]

Prints the median relative difference of `direct` for each scene and fails above 2 %. Pixels at edges, where Mitsuba
averages over a pixel that the viewer samples at its centre, and half shadows, where a shadow map is soft over some
texels, hardly move a median; they are counted all the same.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ssil_viewer import headless  # noqa: E402
from ssil_viewer.scene import default_camera, load_scene  # noqa: E402
from ssil_viewer.scene.model import Camera, Image, Light, Material, Scene, TextureRef  # noqa: E402
from ssil_viewer.settings import Settings  # noqa: E402
from tests import scenes  # noqa: E402

LIMIT = 0.02


def lambertian(scene: Scene) -> Scene:
    """The scene without what Mitsuba is not asked for: reflections, normal maps, occlusion maps, and masked surfaces,
    which count as a bounce there."""
    solid = {i for i, m in enumerate(scene.materials) if m.alpha_mode == "opaque"}
    meshes = tuple(replace(mesh, primitives=tuple(p for p in mesh.primitives if p.material in solid))
                   for mesh in scene.meshes)
    return replace(scene, meshes=meshes, materials=tuple(
        replace(m, specular=0.0, metallic=0.0, metallic_roughness_texture=None, normal_texture=None,
                occlusion_texture=None) for m in scene.materials))


def _texture(mi, scene: Scene, ref: TextureRef, factor: tuple[float, ...]) -> dict:
    pixels = scene.images[ref.image].pixels[..., :3].astype(np.float32) / 255
    linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4) * np.float32(factor[:3])
    return {"type": "bitmap", "bitmap": mi.Bitmap(linear.astype(np.float32)), "raw": True, "filter_type": "bilinear"}


def _bsdf(mi, scene: Scene, material: Material) -> dict:
    reflectance = ({"type": "rgb", "value": list(material.base_color[:3])} if material.base_color_texture is None
                   else _texture(mi, scene, material.base_color_texture, material.base_color))
    bsdf = {"type": "diffuse", "reflectance": reflectance}
    if material.double_sided:
        bsdf = {"type": "twosided", "nested": bsdf}
    return bsdf


def _meshes(mi, scene: Scene) -> dict:
    """One Mitsuba mesh for each primitive of each instance, in world space."""
    found = {}
    for instance in scene.instances:
        for primitive in scene.meshes[instance.mesh].primitives:
            matrix = instance.world_from_object
            flipped = np.linalg.det(matrix[:3, :3]) < 0
            props = mi.Properties()
            bsdf = mi.load_dict(_bsdf(mi, scene, scene.materials[primitive.material]))
            props["mesh_bsdf"] = bsdf
            emission = scene.materials[primitive.material].emission
            mesh = mi.Mesh(f"mesh{len(found)}", len(primitive.positions), len(primitive.indices),
                           has_vertex_normals=True, has_vertex_texcoords=True, props=props)
            values = mi.traverse(mesh)
            positions = primitive.positions @ matrix[:3, :3].T + matrix[:3, 3]
            normals = primitive.normals @ np.linalg.inv(matrix[:3, :3])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
            values["vertex_positions"] = np.ravel(positions).astype(np.float32)
            values["vertex_normals"] = np.ravel(normals).astype(np.float32)
            values["vertex_texcoords"] = np.ravel(primitive.texcoords[:, 0]).astype(np.float32)
            faces = primitive.indices[:, ::-1] if flipped else primitive.indices
            values["faces"] = np.ravel(faces).astype(np.uint32)
            values.update()
            if max(emission) > 0:
                raise SystemExit("emissive surfaces light nothing in `direct`: leave them out of the comparison")
            found[f"mesh{len(found)}"] = mesh
    return found


def _emitter(mi, light: Light) -> dict:
    """A light. Mitsuba's spots soften their edge differently: the comparison's spot has a narrow one."""
    power = {"type": "rgb", "value": [c * light.intensity for c in light.color]}
    if light.kind == "point":
        return {"type": "point", "position": list(light.position), "intensity": power}
    if light.kind == "directional":
        return {"type": "directional", "direction": list(light.direction), "irradiance": power}
    to = mi.ScalarTransform4f().look_at(origin=list(light.position),
                                        target=list(np.add(light.position, light.direction)), up=[1, 0.1, 0.2])
    return {"type": "spot", "to_world": to, "intensity": power, "cutoff_angle": math.degrees(light.outer_cone),
            "beam_width": math.degrees(light.inner_cone)}


def mitsuba_direct(scene: Scene, camera: Camera, size: tuple[int, int], samples: int) -> np.ndarray:
    """(H, W, 3) radiance of direct light."""
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    described = {
        "type": "scene", "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
        "sensor": {"type": "perspective", "fov": math.degrees(camera.vertical_fov), "fov_axis": "y",
                   "near_clip": 1e-3, "to_world": mi.ScalarTransform4f().look_at(
                       origin=list(camera.eye), target=list(camera.target), up=list(camera.up)),
                   "sampler": {"type": "independent", "sample_count": samples},
                   "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "pixel_format": "rgb",
                            "rfilter": {"type": "box"}}},
        **_meshes(mi, scene),
        **{f"light{i}": _emitter(mi, light) for i, light in enumerate(scene.lights)},
    }
    return np.array(mi.render(mi.load_dict(described)))


def _textured_plane() -> tuple[Scene, Camera]:
    rng = np.random.default_rng(2)
    pixels = np.full((64, 64, 4), 255, np.uint8)
    pixels[..., :3] = rng.integers(30, 255, (8, 8, 3)).repeat(8, 0).repeat(8, 1)
    plane = scenes.rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4))
    material = Material(base_color_texture=TextureRef(0), specular=0.0)
    light = Light("point", intensity=6.0, position=(0.5, 1.5, 0.2))
    return (replace(scenes.scene((plane,), (material,), (light,)), images=(Image("tiles", pixels),)),
            Camera(eye=(0, 2, 3), vertical_fov=0.9))


def _cases() -> dict[str, tuple[Scene, Camera]]:
    box = scenes.cornell()
    spot = Light("spot", intensity=6.0, position=(0, 0.95, 0.3), direction=(0.0, -0.9578, -0.2873), inner_cone=0.6,
                 outer_cone=0.61)
    sun = Light("directional", intensity=3.0, direction=(0.48, -0.6, -0.64))
    atrium = load_scene("builtin:atrium")
    return {
        "cornell": (box, scenes.CORNELL_CAMERA),
        "spot": (replace(box, lights=(spot,)), scenes.CORNELL_CAMERA),
        "directional": (replace(box, lights=(sun,)), scenes.CORNELL_CAMERA),
        "textured plane": _textured_plane(),
        "atrium": (lambertian(atrium), default_camera(atrium)),
    }


def main() -> int:
    """Compare and report; 1 when a median is above the limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="640x360", help="image size (default 640x360)")
    parser.add_argument("--samples", type=int, default=16, help="Mitsuba's samples per pixel (default 16)")
    arguments = parser.parse_args()
    size = tuple(int(part) for part in arguments.size.split("x"))
    worst = 0.0
    for name, (scene, camera) in _cases().items():
        ours = headless.render(scene, size=size, camera=camera, settings=Settings(bounces=0, shadow_resolution=4096))
        truth = mitsuba_direct(scene, camera, size, arguments.samples)
        seen = (truth.sum(-1) > 0) & (ours["view_depth"] > 0)
        lit = seen & (truth.sum(-1) > 0.05 * np.median(truth.sum(-1)[seen]))
        difference = np.abs(ours["direct"] - truth).sum(-1)[lit] / truth.sum(-1)[lit]
        median, p90 = np.percentile(difference, (50, 90))
        ratio = ours["direct"][lit].sum() / truth[lit].sum()
        bright = ours["direct"].sum(-1) > 0.05 * np.median(truth.sum(-1)[seen])
        leaks = (bright & (ours["view_depth"] > 0) & (truth.sum(-1) == 0)).sum() / lit.sum()
        print(f"{name:16} median {median:.4f}  90 % {p90:.4f}  sum/sum {ratio:.4f}  lit in shadow {leaks:.4f}",
              flush=True)
        worst = max(worst, float(median))
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
