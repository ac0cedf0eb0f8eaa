"""The viewer's material as a BSDF of Mitsuba: a Lambertian part and, if wanted, that of shaders/lib/brdf.glsl."""

from __future__ import annotations

from typing import Any

import numpy as np

NAME = "ssil_surface"
LEAST_ALPHA = 2e-3      # as in brdf_ggx
LEAST_FACING = 0.01     # as in turned_to_camera of shaders/lib/normals.glsl

_LEAST_SPECULAR = 0.01
"""Without any dielectric reflection Mitsuba's principled metals lose their colour: its index is 1 then."""


def surface_as_bsdf(bsdf: dict[str, Any], mirrors: bool, vector: bool) -> dict[str, Any]:
    """A described bsdf (see `mitsuba_export`) as what Mitsuba has for it.

    Args:
        mirrors: Whether materials of the type "surface" reflect otherwise than as Lambertian ones, too.
        vector: Whether Mitsuba traces many rays at once. For one at a time a BSDF in Python takes fifty times as
            long as its own ones: then it is a tree of those, and a reflection is Disney's principled material.
    """
    if not vector:
        return _own_bsdf(bsdf, mirrors)
    if bsdf["type"] == "mask":
        return bsdf | {"bsdf": surface_as_bsdf(bsdf["bsdf"], mirrors, vector)}
    found: dict[str, Any] = {"type": NAME, "two_sided": False}
    while "bsdf" in bsdf:
        if bsdf["type"] == "twosided":
            found["two_sided"] = True
        else:
            found["normal_map"] = bsdf["normalmap"]
        bsdf = bsdf["bsdf"]
    if bsdf["type"] == "diffuse":
        return found | {"base_color": bsdf["reflectance"], "roughness": 1.0, "metallic": 0.0, "dielectric": 0.0,
                        "mirrors": False}
    return found | {name: bsdf[name] for name in ("base_color", "roughness", "metallic")} | {
        "dielectric": float(bsdf["dielectric"]), "mirrors": mirrors}


def _own_bsdf(bsdf: dict[str, Any], mirrors: bool) -> dict[str, Any]:
    """The same as a tree of Mitsuba's own ones."""
    if bsdf["type"] != "surface":
        inner = {key: _own_bsdf(value, mirrors) for key, value in bsdf.items()
                 if key == "bsdf" and isinstance(value, dict)}
        return bsdf | inner
    base, metallic = bsdf["base_color"], bsdf["metallic"]
    maps = {"base_color": base, "roughness": bsdf["roughness"], "metallic": metallic}
    if not mirrors and not isinstance(metallic, dict) and "name" not in base:
        key = "data" if "data" in base else "value"
        dimmed = base | {key: np.multiply(base[key], 1 - metallic).astype(np.float32)}
        return {"type": "diffuse", "reflectance": dimmed | ({} if key == "data" else {key: dimmed[key].tolist()})}
    if not mirrors:
        return {"type": NAME, **maps, "dielectric": float(bsdf["dielectric"]), "mirrors": False}
    rough = maps["roughness"]
    rough = rough | {"data": np.maximum(rough["data"], 0.03)} if isinstance(rough, dict) else max(rough, 0.03)
    return {"type": "principled", **maps, "roughness": rough,
            "specular": min(max(bsdf["mean_dielectric"] / 0.08, _LEAST_SPECULAR), 1.0)}


def register(mi) -> None:
    """Makes {"type": "ssil_surface"} known to Mitsuba, whose variant is set.

    Textures `base_color`, `roughness` and `metallic`; `dielectric`, the reflectance of non-metals at normal incidence,
    which fades out from roughness 0.8 to 1; `mirrors`, whether there is anything but the Lambertian part; `two_sided`,
    whether the back reflects, too; `normal_map`, optional, whose third axis is across normal and dP/du.

    Normals are those of shaders/passes/gbuffer.frag.glsl: interpolated and mapped ones that face away from who sees
    their triangle are turned until they do not, where Mitsuba's own BSDFs are black. Light from behind the triangle
    does not arrive.
    """
    import drjit as dr

    def texture(value):
        """Mitsuba hands numbers and colours over as they are, not as the textures that it makes of them elsewhere."""
        if isinstance(value, mi.Texture):
            return value
        if isinstance(value, (int, float)):
            return mi.load_dict({"type": "uniform", "value": float(value)})
        return mi.load_dict({"type": "srgb", "color": mi.ScalarColor3d(value)})

    class Surface(mi.BSDF):
        """Albedo / pi, plus GGX with Schlick's reflectance and height-correlated masking (shaders/lib/brdf.glsl)."""

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self._base, self._rough, self._metal = (
                texture(props[name]) for name in ("base_color", "roughness", "metallic"))
            self._dielectric, self._mirrors = float(props.get("dielectric", 0.0)), bool(props.get("mirrors", True))
            self._two_sided = bool(props.get("two_sided", False))
            self._normals = texture(props["normal_map"]) if "normal_map" in props else None
            flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
            if self._two_sided:
                flags |= mi.BSDFFlags.BackSide
            if self._mirrors:
                flags |= mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.SpatiallyVarying
            self.m_flags, self.m_components = int(flags), [int(flags)]

        def _frame(self, si, active):
            """The shading frame, wi in it, the triangle's normal on the side of wi, and whether that side reflects."""
            wi = si.to_world(si.wi)
            side = dr.select(dr.dot(si.n, wi) < 0, -1.0, 1.0)
            n = si.sh_frame.n * side
            if self._normals is not None:
                mapped = 2 * self._normals.eval_3(si, active) - 1
                t = dr.normalize(si.dp_du - n * dr.dot(n, si.dp_du))
                n = dr.normalize(t * mapped.x + dr.cross(n, t) * (side * mapped.y) + n * mapped.z)
            facing = dr.dot(n, wi)
            n = dr.normalize(n + wi * dr.maximum(LEAST_FACING - facing, 0))
            frame = mi.Frame3f(n)
            return frame, frame.to_local(wi), si.n * side, (side > 0) | self._two_sided

        def _seen(self, si, wo, active):
            """wi and wo in the shading frame, and whether light goes from one to the other."""
            frame, wi, triangle, reflects = self._frame(si, active)
            outward = si.to_world(wo)
            wo = frame.to_local(outward)
            return wi, wo, active & reflects & (wi.z > 0) & (wo.z > 0) & (dr.dot(triangle, outward) > 0)

        def _parts(self, si, active):
            """Albedo, reflectance at normal incidence, alpha, and the share of samples that the reflection gets."""
            base, metal = self._base.eval(si, active), self._metal.eval_1(si, active)
            albedo = base * (1 - metal)
            if not self._mirrors:
                return albedo, mi.Color3f(0), mi.Float(1), mi.Float(0)
            rough = self._rough.eval_1(si, active)
            step = dr.clip((rough - 0.8) / 0.2, 0, 1)
            dielectric = self._dielectric * (1 - step * step * (3 - 2 * step))
            f0 = dielectric + (base - dielectric) * metal
            mirror, diffuse = mi.luminance(f0), mi.luminance(albedo)
            # A lobe that is weak at normal incidence is strong at grazing angles: it gets a fifth of the samples
            share = dr.select(mirror > 0, dr.maximum(mirror / dr.maximum(mirror + diffuse, 1e-6), 0.2), 0)
            return albedo, f0, dr.maximum(rough * rough, LEAST_ALPHA), share

        def _lobe(self, f0, alpha, wi, wo):
            """The reflection without the cosine, sr^-1."""
            half = dr.normalize(wi + wo)
            n_dot_l, n_dot_v = dr.maximum(wo.z, 1e-4), dr.maximum(wi.z, 1e-4)
            a2 = alpha * alpha
            d = half.z * half.z * (a2 - 1) + 1
            distribution = a2 / (dr.pi * d * d)
            smith = (n_dot_l * dr.sqrt(n_dot_v * n_dot_v * (1 - a2) + a2)
                     + n_dot_v * dr.sqrt(n_dot_l * n_dot_l * (1 - a2) + a2))
            fresnel = f0 + (1 - f0) * dr.power(dr.clip(1 - dr.dot(wi, half), 0, 1), 5)
            return fresnel * (distribution * 0.5 / smith)

        def _value(self, parts, wi, wo):
            albedo, f0, alpha, _ = parts
            value = albedo * dr.inv_pi
            if self._mirrors:
                value = value + dr.select(dr.max(f0) > 0, self._lobe(f0, alpha, wi, wo), 0)
            return value * wo.z

        def _density(self, parts, wi, wo):
            _, _, alpha, share = parts
            cosine = mi.warp.square_to_cosine_hemisphere_pdf(wo)
            if not self._mirrors:
                return cosine
            half = dr.normalize(wi + wo)
            distribution = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)
            lobe = distribution.pdf(wi, half) / dr.maximum(4 * dr.dot(wo, half), 1e-7)
            return share * dr.select(share > 0, lobe, 0) + (1 - share) * cosine

        def sample(self, ctx, si, sample1, sample2, active=True):
            """A direction by either part."""
            frame, wi, triangle, reflects = self._frame(si, active)
            parts = self._parts(si, active)
            wo = mi.warp.square_to_cosine_hemisphere(sample2)
            if self._mirrors:
                distribution = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, parts[2], True)
                half, _ = distribution.sample(wi, sample2)
                wo = dr.select(sample1 < parts[3], mi.reflect(wi, half), wo)
            outward = frame.to_world(wo)
            found = dr.zeros(mi.BSDFSample3f)
            found.wo, found.eta = si.to_local(outward), 1.0
            found.sampled_type, found.sampled_component = mi.UInt32(self.m_flags), mi.UInt32(0)
            found.pdf = self._density(parts, wi, wo)
            good = (active & reflects & (wi.z > 0) & (wo.z > 0) & (found.pdf > 0)
                    & (dr.dot(triangle, outward) > 0))
            value = self._value(parts, wi, wo) / dr.select(good, found.pdf, 1)
            return found, dr.select(good, value, 0)

        def eval(self, ctx, si, wo, active=True):
            """The BSDF times the cosine."""
            wi, wo, good = self._seen(si, wo, active)
            return dr.select(good, self._value(self._parts(si, active), wi, wo), 0)

        def pdf(self, ctx, si, wo, active=True):
            """Of `sample`."""
            wi, wo, good = self._seen(si, wo, active)
            return dr.select(good, self._density(self._parts(si, active), wi, wo), 0)

        def eval_pdf(self, ctx, si, wo, active=True):
            """Both at once."""
            wi, wo, good = self._seen(si, wo, active)
            parts = self._parts(si, active)
            return dr.select(good, self._value(parts, wi, wo), 0), dr.select(good, self._density(parts, wi, wo), 0)

        def traverse(self, callback):
            """Its textures."""
            for name, texture in (("base_color", self._base), ("roughness", self._rough), ("metallic", self._metal),
                                  ("normal_map", self._normals)):
                if texture is not None:
                    callback.put(name, texture, mi.ParamFlags.Differentiable)

        def to_string(self):
            """Its name."""
            return NAME

    mi.register_bsdf(NAME, Surface)
