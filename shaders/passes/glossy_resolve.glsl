// Reflected radiance of the image: brought up from the starting level, and averaged over frames along the surface's
// motion. UPSAMPLING: 0 bilateral, 1 nearest.
#include "passes/glossy_common.glsl"
#ifdef HAS_HISTORY
#define HISTORY_AT(px) vec4(load_history(px), 0.0)
#include "lib/reproject.glsl"
#endif

Reflection from_start_level(ivec2 px, Surface receiver, float roughness) {
    ivec2 last = size_glossy_light() - 1;
    vec2 at_level = (vec2(px) + 0.5) / texel - 0.5;
#if UPSAMPLING == 1
    Reflection own = load_glossy_light(min(ivec2(at_level + 0.5), last));
    return Reflection(own.radiance, roughness, 4.0);
#else
    vec3 p = position_from_ray(ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin), receiver.view_depth);
    // The nearest texel and its nearest neighbours along either axis
    vec2 own = floor(at_level + 0.5), f = at_level - own;
    ReflectionSum sum = no_reflection();
    for (int i = 0; i < 3; ++i) {
        ivec2 step = ivec2(i == 1 ? (f.x < 0.0 ? -1 : 1) : 0, i == 2 ? (f.y < 0.0 ? -1 : 1) : 0);
        ivec2 at = clamp(ivec2(own) + step, ivec2(0), last);
        Reflection tap = load_glossy_light(at);
        Surface there = load_start_surface(at);
        vec2 ray = ray_from_pixel(vec2(at) + 0.5, frame.ray_scale * texel, frame.ray_origin);
        float kernel = i == 0 ? 1.0 - abs(f.x) - abs(f.y) : i == 1 ? abs(f.x) : abs(f.y);
        float weight = kernel * reflection_agreement(receiver, p, roughness, there, ray, tap.roughness);
        add_reflection(sum, tap, weight, abs(there.view_depth - receiver.view_depth));
    }
    return mean_reflection(sum, roughness);
#endif
}

#ifdef HAS_HISTORY
// Mean over frames. Its length is that of the irradiance's, found by the same surface under the same tests.
vec3 with_history(ivec2 px, Surface surface, Reflection now) {
    float frames = load_irradiance(px).a;
    if (frame.history_frames == 0 || frames <= 1.0) return now.radiance;
    vec4 history;
    if (!find_history(px, surface, 0.9, history)) return now.radiance;
    // What moves over the screen reflects something else than before: fewer frames, the more so the smoother it is.
    float still = 1.0 - smoothstep(0.25, 1.0, length(moved_pixels(load_motion(px))));
    float count = min(frames, mix(mix(4.0, 16.0, now.roughness), frames, still));
    // The history may be what the texels around have gathered now, give or take twice their spread: with once, its
    // rare peaks were cut off and the mean fell by 1 %
    vec3 low = now.radiance * max(0.75 - 2.0 * now.spread, 0.0), high = now.radiance * (1.25 + 2.0 * now.spread);
    return mix(clamp(history.rgb, low, high), now.radiance, 1.0 / count);
}
#endif

void shade(ivec2 px) {
    out_reflection = vec3(0.0);
    Surface surface = load_surface(px);
    vec4 specular = load_specular(px);
    if (surface.view_depth <= 0.0 || max(max(specular.r, specular.g), specular.b) <= 0.0) return;
    Reflection now = from_start_level(px, surface, specular.a);
#ifdef HAS_HISTORY
    out_reflection = with_history(px, surface, now);
#else
    out_reflection = now.radiance;
#endif
}
