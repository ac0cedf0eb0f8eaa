// Reflectance models. All vectors are unit length and point away from the surface.

const float PI = 3.141592653589793;

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
