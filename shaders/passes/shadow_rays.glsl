// Which lamps a pixel sees, by rays against the scene's triangles, wherever their shadow maps leave light: two bits a lamp,
// 0 where the map's answer holds. It does where the triangle faces away from the lamp: its soft edge hides where smooth
// normals and triangles disagree.
#include "lib/lights.glsl"
#include "lib/scene_rays.glsl"

// Share of its way at which a ray to a lamp ends: what the lamp is fixed to does not hide it. Shadow maps see nothing so
// close to it, either.
const float BEFORE_LAMP = 1.0 - 1e-3;

void shade(ivec2 px) {
    out_traced = 0u;
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin);
    mat3 world_rotation = mat3(frame.world_from_view);
    vec3 position = to_world(position_from_ray(ray, surface.view_depth));
    vec3 n = normalize(world_rotation * surface.normal);
    vec3 triangle = normalize(world_rotation * decode_direction16(load_motion(px).w));
    vec3 from = position + triangle * (RAY_LIFT * surface.view_depth);
    uint found = 0u;
    int i = 0, lamps = min(punctual_lights, TRACED_LAMPS);
    if (lamps > 0) do {
        Light light = fetch_light(texture_lights, i);
        vec3 wi;
        vec3 incoming = light_irradiance(light, position, wi);
        if (light.first_tile < 0 || dot(triangle, wi) <= 0.0 || !lights_front(incoming, dot(n, wi))) continue;
        if (shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n, triangle, wi) <= 0.0) continue;
        vec3 end = light.kind == LIGHT_DIRECTIONAL ? from + wi * (length(position) + extent)
                                                   : mix(from, light.position, BEFORE_LAMP);
        found |= (is_blocked(from, end) ? LAMP_HIDDEN : LAMP_SEEN) << uint(2 * i);
    } while (++i < lamps);
    out_traced = found;
}
