// Light of surfaces that the image may not show, at points of world space. Needs the tables of lights, what
// lib/scene_rays.glsl needs, and the uniforms `punctual_lights` and `random_seed`. ENVIRONMENT: there is one.
#include "lib/lights.glsl"
#include "lib/hash.glsl"
#include "lib/hemisphere.glsl"
#include "lib/pi.glsl"
#include "lib/scene_rays.glsl"
#ifdef ENVIRONMENT
#include "lib/environment.glsl"
#endif

vec3 direct_irradiance(vec3 position, vec3 n) {
    vec3 irradiance = vec3(0.0);
    int i = 0;
    if (punctual_lights > 0) do {
        Light light = fetch_light(texture_lights, i);
        vec3 wi;
        vec3 incoming = light_irradiance(light, position, wi);
        float n_dot_l = dot(n, wi);
        if (lights_front(incoming, n_dot_l))
            irradiance += incoming * (n_dot_l * shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n, n, wi));
    } while (++i < punctual_lights);
#ifdef AREA_LIGHTS
    i = punctual_lights;
    if (i < frame.light_count) do {
        AreaLight light = fetch_area_light(texture_lights, i);
        float gathered = area_irradiance(light, position, n);
        if (gathered > 0.0)
            irradiance += light.radiance
                        * (gathered * area_shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n, n));
    } while (++i < frame.light_count);
#endif
    return irradiance;
}

#ifdef ENVIRONMENT
// The environment's irradiance if one ray, drawn by the cosine, gets out. In the mean it is the share that gets out,
// whatever the environment's light does in the directions that are blocked.
vec3 environment_light(uint random, vec3 position, vec3 n) {
    vec3 away = cosine_direction(n, unit_float(random), unit_float(hash(random)));
    float reach = length(position) + extent;
    if (is_blocked(position + (n + away) * (1e-5 * extent), position + away * reach)) return vec3(0.0);
    vec3 normal = environment_direction(n, frame.environment_turn);
    return environment_irradiance(texture_environment_irradiance, normal) * frame.environment_strength;
}
#endif

// Radiance that a Lambertian surface sends on, from direct light, environment and emission.
vec3 lambert_radiance(uint random, vec3 position, vec3 n, vec3 albedo, vec3 emission) {
    vec3 irradiance = direct_irradiance(position, n);
#ifdef ENVIRONMENT
    irradiance += environment_light(random, position, n);
#endif
    return finite_half(emission + albedo * irradiance * (1.0 / PI));
}

// How far from a plane a pixel may be that shows it, a share of the depth, or as many pixels if that is more; how far turned,
// the least cosine. Also in ssil_viewer/reference/shown.py.
const float SHOWN_REACH = 3e-3, SHOWN_PIXELS = 1.5, SHOWN_FACING = 0.5;

// Whether a pixel lies on the plane through a point, and faces the same way.
bool shows_plane(ivec2 at, vec3 position, vec3 n) {
    if (!is_on_screen(at, size_image_surface())) return false;
    float depth = load_image_surface(at).view_depth;
    if (depth <= 0.0) return false;
    vec3 shown = position_from_ray(ray_from_pixel(vec2(at) + 0.5, frame.ray_scale, frame.ray_origin), depth);
    float reach = max(SHOWN_REACH, SHOWN_PIXELS * max(frame.ray_scale.x, frame.ray_scale.y));
    return abs(dot(shown - position, n)) < -reach * position.z
        && dot(decode_direction16(load_motion(at).w), n) > SHOWN_FACING;
}

// Whether the image shows a surface at a point of view space, so that the gather has its light already: it is not hidden,
// and a pixel lies on its plane, its own or one next to it. A ledge seen edge-on is in plain sight and has none. Needs the
// reads `image_surface` and `motion`.
bool is_shown(vec3 position, vec3 n) {
    float depth = -position.z;
    vec3 to_camera = -position;
    float facing = dot(n, to_camera);
    if (depth < frame.near || facing <= 0.0) return false;
    vec2 pixel = (position.xy / depth - frame.ray_origin) / frame.ray_scale;
    ivec2 at = ivec2(floor(pixel));
    if (any(lessThan(pixel, vec2(0.0))) || any(greaterThanEqual(at, size_image_surface()))) return false;
    float shown = load_image_surface(at).view_depth;
    // By so much does the depth of a plane differ within a pixel and its neighbours; held at grazing angles
    float cosine = facing * inversesqrt(dot(to_camera, to_camera));
    float slope = min(sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 1e-3), 100.0);
    float tolerance = depth * (1e-3 + 1.5 * max(frame.ray_scale.x, frame.ray_scale.y) * slope);
    if (shown <= 0.0 || depth >= shown + tolerance) return false;
    if (shows_plane(at, position, n)) return true;
    for (int i = 0; i < 9; ++i)
        if (i != 4 && shows_plane(at + ivec2(i % 3, i / 3) - 1, position, n)) return true;
    return false;
}

// Whether it sends unseen light. VIEW_ALONE: only what the camera sees between pixels does.
bool sends_unseen(vec3 position, vec3 n) {
    if (is_shown(position, n)) return false;
#ifdef VIEW_ALONE
    vec2 pixel = (position.xy / -position.z - frame.ray_origin) / frame.ray_scale;
    return position.z < -frame.near && dot(n, position) < 0.0 && is_on_screen(ivec2(floor(pixel)), size_image_surface())
        && !is_blocked(to_world(position * (1.0 - RAY_LIFT)), to_world(vec3(0.0)));
#else
    return true;
#endif
}

// Radiance of what a ray meets first, where the image does not show it; black where it meets nothing. In view space. Needs the
// table `triangle_colors`.
vec3 unseen_radiance(vec3 from, vec3 along, uint random) {
    vec3 start = to_world(from), way = mat3(frame.world_from_view) * along;
    Met met = first_met(start, way);
    if (met.triangle < 0) return vec3(0.0);
    vec4 colors = fetch_row_major(texture_triangle_colors, met.triangle);
    vec3 n = normalize(met.normal);
    bool back = dot(n, way) > 0.0;
    if (back && colors.w < 0.0) return vec3(0.0);
    if (back) n = -n;
    if (!sends_unseen(from + along * met.at, mat3(frame.view_from_world) * n)) return vec3(0.0);
    int code = int(abs(colors.w)) - 1;
    vec3 albedo = vec3(code & 255, (code >> 8) & 255, code >> 16) * (1.0 / 255.0);
    return lambert_radiance(hash(random), start + way * met.at, n, albedo * albedo, colors.rgb);
}
