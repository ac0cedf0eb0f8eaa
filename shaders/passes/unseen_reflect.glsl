// Reflection of what the image does not show, for a reflectance of 1: rays drawn by the lobe, and the light of what they
// meet.
#include "lib/unseen.glsl"
#include "passes/glossy_receiver.glsl"

// A unit vector about r with a density of (e + 1) / (2 pi) cos^e.
vec3 lobe_direction(vec3 r, float exponent, float u, float v) {
    float turn = 2.0 * PI * u, height = pow(max(v, 1e-7), 1.0 / (exponent + 1.0));
    vec3 across = normalize(cross(r, abs(r.x) < 0.9 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 0.0, 1.0)));
    return r * height + (across * cos(turn) + cross(r, across) * sin(turn)) * sqrt(max(1.0 - height * height, 0.0));
}

void shade(ivec2 px) {
    out_unseen_reflection = vec3(0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    vec3 position = position_from_ray(ray, surface.view_depth), normal = normalize(surface.normal);
    float roughness = what_is_kept(px, surface, position).roughness;
    if (roughness < 0.0) return;
    Mirror mirror = mirror_of(roughness, position, normal);
    vec3 from = position * (1.0 - RAY_LIFT) + normal * (RAY_LIFT * surface.view_depth);
    uint random = hash(uint(px.x + (px.y << 14)) ^ hash(uint(random_seed) * 2654435761u + 29u));
    float reach = length(to_world(position)) + extent;
    vec3 sum = vec3(0.0);
    int i = 0;
    do {
        random = hash(random);
        float u = unit_float(random);
        random = hash(random);
        vec3 direction = lobe_direction(mirror.direction, mirror.exponent, u, unit_float(random));
        float cosine = dot(normal, direction);
        if (cosine > 0.0) sum += unseen_radiance(from, direction * reach, random) * cosine;
    } while (++i < rays);
    // Lobe over density
    float e = mirror.exponent;
    out_unseen_reflection = sum * ((e + 2.0) / (e + 1.0) * mirror.scale / float(rays));
}
