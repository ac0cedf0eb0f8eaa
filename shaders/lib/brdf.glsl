// Reflectance models. All vectors are unit length and point away from the surface.
#include "lib/pi.glsl"

vec3 fresnel_schlick(vec3 f0, float v_dot_h) {
    float m = clamp(1.0 - v_dot_h, 0.0, 1.0);
    float m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

// Schlick's reflectance averaged over a rough lobe, whose microfacets are not all seen at the grazing angle of the whole
// (Lagarde 2011). Materials below 2 %, which no real one is, fade out at grazing angles, too (Filament 4.8.2).
vec3 fresnel_rough(vec3 f0, float roughness, float n_dot_v) {
    float m = clamp(1.0 - n_dot_v, 0.0, 1.0), m2 = m * m;
    float fade = clamp(50.0 * max(max(f0.r, f0.g), f0.b), 0.0, 1.0);
    return f0 + max(vec3(1.0 - roughness) * fade - f0, 0.0) * (m2 * m2 * m);
}

// Microfacet reflection with the GGX distribution and the height-correlated Smith term
// (Walter et al. 2007; Heitz 2014). Returns the BRDF without the cosine, sr^-1.
vec3 brdf_ggx(vec3 f0, float roughness, vec3 n, vec3 wo, vec3 wi) {
    vec3 h = normalize(wo + wi);
    float n_dot_l = max(dot(n, wi), 1e-4), n_dot_v = max(abs(dot(n, wo)), 1e-4), n_dot_h = max(dot(n, h), 0.0);
    float alpha = max(roughness * roughness, 2e-3), a2 = alpha * alpha;
    float d = n_dot_h * n_dot_h * (a2 - 1.0) + 1.0;
    float distribution = a2 / (PI * d * d);
    float smith = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2)
                + n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2);
    return fresnel_schlick(f0, max(dot(wo, h), 0.0)) * (distribution * 0.5 / smith);
}

// Highlight of an area of even radiance, over that radiance, from its irradiance over radiance and its representative
// direction. The distribution is widened by the area's extent (sin^2 of its half angle) and lowered in proportion (Karis
// 2013); a mirror shows no more than the area's own radiance.
vec3 area_highlight(vec3 f0, float roughness, vec3 n, vec3 wo, vec3 wi, float irradiance, float extent) {
    float alpha = max(roughness * roughness, 2e-3);
    float lowered = alpha / min(alpha + 0.5 * sqrt(extent), 1.0);
    return min(brdf_ggx(f0, roughness, n, wo, wi) * (irradiance * lowered * lowered), vec3(1.0));
}

// Integral of the GGX BRDF over a hemisphere of even light (the split sum's second half), fitted: Karis 2014, "Physically
// based shading on mobile", after Lazarov.
vec3 environment_brdf(vec3 f0, float roughness, float n_dot_v) {
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * n_dot_v)) * r.x + r.y;
    vec2 scale = vec2(-1.04, 1.04) * a + r.zw;
    // Black stays black: a material without a specular lobe gets none at grazing angles either
    return max(f0 * scale.x + scale.y * clamp(50.0 * max(max(f0.r, f0.g), f0.b), 0.0, 1.0), vec3(0.0));
}

// Occlusion of a reflection from that of diffuse light (Lagarde and de Rousiers 2014).
float specular_occlusion(float n_dot_v, float open, float roughness) {
    return clamp(pow(max(n_dot_v + open, 0.0), exp2(-16.0 * roughness - 1.0)) - 1.0 + open, 0.0, 1.0);
}
