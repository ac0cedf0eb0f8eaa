"""What a scene holds, as data for scripts and as text for people."""

from __future__ import annotations

import math
from typing import Any

from ssil_viewer.scene.model import Camera, Light, Material, Scene
from ssil_viewer.scene.warning_list import printable

_TEXTURE_FIELDS = {
    "base_color": "base_color_texture",
    "metallic_roughness": "metallic_roughness_texture",
    "normal": "normal_texture",
    "occlusion": "occlusion_texture",
    "emission": "emission_texture",
}

_MAX_LINES = 40
"""Entries of a kind that the text lists; the data always hold all."""


def describe(scene: Scene) -> dict[str, Any]:
    """The contents of a scene as plain values that `json` can write.

    Returns:
        Keys `name`, `triangles` (drawn, so instances count each time), `vertices` (stored), `meshes`, `instances`,
        `materials`, `textures`, `lights`, `environment` (or None), `cameras`, `animations`, `bounds` (`min` and `max`,
        metres) and `warnings`. Angles are degrees.
    """
    low, high = scene.bounds()
    return {
        "name": scene.name,
        "triangles": scene.triangle_count,
        "vertices": sum(len(p.positions) for mesh in scene.meshes for p in mesh.primitives),
        "meshes": len(scene.meshes),
        "instances": len(scene.instances),
        "materials": [_material(scene, material) for material in scene.materials],
        "textures": [
            {"name": image.name, "width": image.pixels.shape[1], "height": image.pixels.shape[0]}
            for image in scene.images
        ],
        "lights": [_light(light) for light in scene.lights],
        "environment": _environment(scene),
        "cameras": [_camera(camera) for camera in scene.cameras],
        "animations": list(scene.animations),
        "bounds": {"min": low.tolist(), "max": high.tolist()},
        "warnings": list(scene.warnings),
    }


def _material(scene: Scene, material: Material) -> dict[str, Any]:
    references = {slot: getattr(material, name) for slot, name in _TEXTURE_FIELDS.items()}
    return {
        "name": material.name,
        "base_color": list(material.base_color),
        "metallic": material.metallic,
        "roughness": material.roughness,
        "emission": list(material.emission),
        "alpha_mode": material.alpha_mode,
        "double_sided": material.double_sided,
        "textures": {slot: scene.images[ref.image].name for slot, ref in references.items() if ref is not None},
    }


def _light(light: Light) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": light.name,
        "kind": light.kind,
        "color": list(light.color),
        "intensity": light.intensity,
    }
    if light.kind != "directional":
        entry["position"] = list(light.position)
    if light.kind in ("point", "spot"):
        entry["range"] = light.range if math.isfinite(light.range) else None
    if light.kind not in ("point", "sphere"):
        entry["direction"] = list(light.direction)
    if light.kind == "spot":
        entry["cone_degrees"] = [math.degrees(light.inner_cone), math.degrees(light.outer_cone)]
    if light.kind == "rectangle":
        entry |= {"width": light.width, "height": light.height, "up": list(light.up)}
    if light.kind in ("disc", "sphere"):
        entry["radius"] = light.radius
    return entry


def _environment(scene: Scene) -> dict[str, Any] | None:
    if scene.environment is None:
        return None
    height, width = scene.environment.radiance.shape[:2]
    return {"name": scene.environment.name, "width": width, "height": height,
            "largest_radiance": float(scene.environment.radiance.max())}


def _camera(camera: Camera) -> dict[str, Any]:
    return {
        "name": camera.name,
        "eye": list(camera.eye),
        "target": list(camera.target),
        "up": list(camera.up),
        "fov": math.degrees(camera.vertical_fov),
    }


def format_description(description: dict[str, Any]) -> str:
    """The text that `info` prints for what `describe` returned; several lines, without the last line break."""
    low, high = description["bounds"]["min"], description["bounds"]["max"]
    size = " x ".join(f"{b - a:.4g}" for a, b in zip(low, high, strict=True))
    lines = [
        printable(description["name"], 200),
        f"  triangles   {description['triangles']:,}",
        f"  vertices    {description['vertices']:,}",
        f"  meshes      {description['meshes']:,} in {description['instances']:,} instances",
        f"  size        {size} m, from {_vector(low)} to {_vector(high)}",
    ]
    lines += _section("materials", [_material_line(m) for m in description["materials"]])
    lines += _section("textures", [f"{t['name']}  {t['width']}x{t['height']}" for t in description["textures"]])
    lines += _section("lights", [_light_line(light) for light in description["lights"]])
    if (map_ := description["environment"]) is not None:
        size = f"{map_['width']}x{map_['height']}, up to {map_['largest_radiance']:.4g} W/m^2/sr"
        lines.append(f"  environment {printable(map_['name'], 200)}  {size}")
    lines += _section("cameras", [_camera_line(index, c) for index, c in enumerate(description["cameras"])])
    lines += _section("animations", description["animations"])
    lines += _section("warnings", description["warnings"])
    return "\n".join(lines)


def _section(title: str, entries: list[str]) -> list[str]:
    lines = [f"  {title:<11} {len(entries) or 'none'}"]
    lines += [f"    {printable(entry, 400)}" for entry in entries[:_MAX_LINES]]
    if len(entries) > _MAX_LINES:
        lines.append(f"    and {len(entries) - _MAX_LINES} more")
    return lines


def _vector(values: list[float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"


def _material_line(material: dict[str, Any]) -> str:
    parts = [material["name"] or "(unnamed)"]
    if material["textures"]:
        parts.append("textures: " + ", ".join(material["textures"]))
    if max(material["emission"]) > 0.0:
        parts.append(f"emits {_vector(material['emission'])}")
    if material["alpha_mode"] != "opaque":
        parts.append(f"alpha {material['alpha_mode']}")
    if material["double_sided"]:
        parts.append("double-sided")
    return "; ".join(parts)


def _light_line(light: dict[str, Any]) -> str:
    kind = light["kind"]
    unit = "W/m^2" if kind == "directional" else "W/sr" if kind in ("point", "spot") else "W/m^2/sr"
    where = f"along {_vector(light['direction'])}" if "direction" in light else ""
    if "width" in light:
        kind += f" {light['width']:.4g} x {light['height']:.4g} m"
    if "radius" in light:
        kind += f" of radius {light['radius']:.4g} m"
    if light["kind"] != "directional":
        where = f"at {_vector(light['position'])} {where}".rstrip()
    return f"{light['name']}; {kind}, {light['intensity']:.4g} {unit}, {where}"


def _camera_line(index: int, camera: dict[str, Any]) -> str:
    eye, target = _vector(camera["eye"]), _vector(camera["target"])
    return f"{index}: {camera['name']}; at {eye}, looks at {target}, fov {camera['fov']:.1f}"
