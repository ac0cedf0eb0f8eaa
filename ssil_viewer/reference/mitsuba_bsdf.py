"""The viewer's material as a BSDF of Mitsuba: a Lambertian part and, if wanted, that of shaders/lib/brdf.glsl."""

from __future__ import annotations

from typing import Any

import numpy as np

NAME = "ssil_surface"
LEAST_ALPHA = 2e-3      # as in brdf_ggx

_LEAST_SPECULAR = 0.01
"""Without any dielectric reflection Mitsuba's principled metals lose their colour: its index is 1 then."""


def surface_as_bsdf(bsdf: dict[str, Any], mirrors: bool, vector: bool) -> dict[str, Any]:
    """A described bsdf with materials of the type "surface" (see `mitsuba_export`) as what Mitsuba has for them.

    Args:
        mirrors: Whether they reflect otherwise than as Lambertian ones, too.
        vector: Whether Mitsuba traces many rays at once. For one at a time a BSDF in Python takes fifty times as
            long as its own ones: then it is Disney's principled material.
    """
    if bsdf["type"] != "surface":
        inner = {key: surface_as_bsdf(value, mirrors, vector) for key, value in bsdf.items()
                 if key == "bsdf" and isinstance(value, dict)}
        return bsdf | inner
    base, metallic = bsdf["base_color"], bsdf["metallic"]
    maps = {"base_color": base, "roughness": bsdf["roughness"], "metallic": metallic}
    if not mirrors and not isinstance(metallic, dict) and "name" not in base:
        key = "data" if "data" in base else "value"
        dimmed = base | {key: np.multiply(base[key], 1 - metallic).astype(np.float32)}
        return {"type": "diffuse", "reflectance": dimmed | ({} if key == "data" else {key: dimmed[key].tolist()})}
    if vector or not mirrors:
        return {"type": NAME, **maps, "dielectric": float(bsdf["dielectric"]), "mirrors": mirrors}
    rough = maps["roughness"]
    rough = rough | {"data": np.maximum(rough["data"], 0.03)} if isinstance(rough, dict) else max(rough, 0.03)
    return {"type": "principled", **maps, "roughness": rough,
            "specular": min(max(bsdf["mean_dielectric"] / 0.08, _LEAST_SPECULAR), 1.0)}


def register(mi) -> None:
    """Makes {"type": "ssil_surface"} known to Mitsuba, whose variant is set.

    Textures `base_color`, `roughness` and `metallic`; `dielectric`, the reflectance of non-metals at normal incidence,
    which fades out from roughness 0.8 to 1; `mirrors`, whether there is anything but the Lambertian part. The front
    alone reflects.
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
            flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
            if self._mirrors:
                flags |= mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.SpatiallyVarying
            self.m_flags, self.m_components = int(flags), [int(flags)]

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
            wi, parts = si.wi, self._parts(si, active)
            wo = mi.warp.square_to_cosine_hemisphere(sample2)
            if self._mirrors:
                distribution = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, parts[2], True)
                half, _ = distribution.sample(wi, sample2)
                wo = dr.select(sample1 < parts[3], mi.reflect(wi, half), wo)
            found = dr.zeros(mi.BSDFSample3f)
            found.wo, found.eta = wo, 1.0
            found.sampled_type, found.sampled_component = mi.UInt32(self.m_flags), mi.UInt32(0)
            found.pdf = self._density(parts, wi, wo)
            good = active & (wi.z > 0) & (wo.z > 0) & (found.pdf > 0)
            value = self._value(parts, wi, wo) / dr.select(good, found.pdf, 1)
            return found, dr.select(good, value, 0)

        def eval(self, ctx, si, wo, active=True):
            """The BSDF times the cosine."""
            good = active & (si.wi.z > 0) & (wo.z > 0)
            return dr.select(good, self._value(self._parts(si, active), si.wi, wo), 0)

        def pdf(self, ctx, si, wo, active=True):
            """Of `sample`."""
            good = active & (si.wi.z > 0) & (wo.z > 0)
            return dr.select(good, self._density(self._parts(si, active), si.wi, wo), 0)

        def eval_pdf(self, ctx, si, wo, active=True):
            """Both at once."""
            good, parts = active & (si.wi.z > 0) & (wo.z > 0), self._parts(si, active)
            return (dr.select(good, self._value(parts, si.wi, wo), 0),
                    dr.select(good, self._density(parts, si.wi, wo), 0))

        def traverse(self, callback):
            """Its textures."""
            for name, texture in (("base_color", self._base), ("roughness", self._rough), ("metallic", self._metal)):
                callback.put(name, texture, mi.ParamFlags.Differentiable)

        def to_string(self):
            """Its name."""
            return NAME

    mi.register_bsdf(NAME, Surface)
