// Reflected radiance from the starting level to the image. UPSAMPLING: 0 bilateral, 1 nearest. SAME_TAPS: all pixels of a
// block of 2x2 look at the same texels, as the starting level's are of four pixels or more. Included by the passes
// that read `surface`, `specular`, and of the starting level `start_surface` and `glossy_light`; uniform `texel`: width of
// a texel of that level in pixels.
#include "lib/taps.glsl"
#include "passes/glossy_common.glsl"

bool is_reflecting(vec4 specular) { return max(max(specular.r, specular.g), specular.b) > 0.0; }

#if defined(BLOCK) && defined(SAME_TAPS)
// The pixels of a block lie on the same side of the middle of their texel, so all have the same taps.
Surface block_surfaces[3];
Reflection block_reflections[3];

#define LOAD_BLOCK load_block
void load_block(ivec2 first) {
    Taps taps = nearest_taps((vec2(first) + 1.0) / texel);
    for (int i = 0; i < 3; ++i) {
        ivec2 at = clamp(taps.at[i], ivec2(0), size_glossy_light() - 1);
        block_surfaces[i] = load_start_surface(at);
        block_reflections[i] = load_glossy_light(at);
    }
}

Surface tap_surface(int i, ivec2 at) { return block_surfaces[i]; }
Reflection tap_reflection(int i, ivec2 at) { return block_reflections[i]; }
#else
Surface tap_surface(int i, ivec2 at) { return load_start_surface(at); }
Reflection tap_reflection(int i, ivec2 at) { return load_glossy_light(at); }
#endif

Reflection reflection_at(ivec2 px, Surface receiver, float roughness) {
    ivec2 last = size_glossy_light() - 1;
    Taps taps = nearest_taps((vec2(px) + 0.5) / texel);
#if UPSAMPLING == 1
    return Reflection(load_glossy_light(min(taps.at[0], last)).radiance, roughness, 4.0);
#else
    Plane plane = tangent_plane(receiver, ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin));
    Reflector reflector = make_reflector(receiver, plane, roughness, taps.at[0], frame.ray_scale * texel);
    Reflection reflections[3];
    vec3 weights, apart;
    for (int i = 0; i < 3; ++i) {
        ivec2 at = clamp(taps.at[i], ivec2(0), last);
        Surface there = tap_surface(i, at);
        reflections[i] = tap_reflection(i, at);
        weights[i] = taps.weights[i]
                   * reflection_agreement(reflector, there, reflections[i].roughness, vec2(at - taps.at[0]));
        apart[i] = apart_in_depth(there, reflections[i], receiver);
    }
    return mean_reflection(reflections, made_up(weights, apart), roughness);
#endif
}
