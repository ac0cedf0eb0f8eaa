// Reflected radiance from the starting level to the image. UPSAMPLING: 0 bilateral, 1 nearest. Included by the passes
// that read `surface`, `specular`, and of the starting level `start_surface` and `glossy_light`; uniform `texel`: width of
// a texel of that level in pixels.
#include "lib/taps.glsl"
#include "passes/glossy_common.glsl"

bool is_reflecting(vec4 specular) { return max(max(specular.r, specular.g), specular.b) > 0.0; }

Reflection reflection_at(ivec2 px, Surface receiver, float roughness) {
    ivec2 last = size_glossy_light() - 1;
    Taps taps = nearest_taps((vec2(px) + 0.5) / texel);
#if UPSAMPLING == 1
    return Reflection(load_glossy_light(min(taps.at[0], last)).radiance, roughness, 4.0);
#else
    Plane plane = tangent_plane(receiver, ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin));
    Reflector reflector = make_reflector(receiver, plane, roughness, taps.at[0], frame.ray_scale * texel);
    ReflectionSum sum = no_reflection();
    for (int i = 0; i < 3; ++i) {
        ivec2 at = clamp(taps.at[i], ivec2(0), last);
        Reflection tap = load_glossy_light(at);
        Surface there = load_start_surface(at);
        float weight = taps.weights[i] * reflection_agreement(reflector, there, tap.roughness, vec2(at - taps.at[0]));
        add_reflection(sum, tap, weight, abs(there.view_depth - receiver.view_depth));
    }
    return mean_reflection(sum, roughness);
#endif
}
