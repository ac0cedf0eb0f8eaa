// A buffer on the screen, each of its texels as one block of pixels. VIEW: 0 radiance or irradiance (exposed and
// tone-mapped), 1 reflectance (as it is), 2 normal, 3 view depth, 4 index 0..3, 5 motion, 6 alpha channel, 7 number of frames.
// `first` is the pixel where the image begins in what was rendered.
#include "lib/color.glsl"
#include "debug/source.glsl"

void shade(ivec2 px) {
    ivec2 at = min(ivec2((vec2(px + first) + 0.5) / texel), size_source() - 1);
    vec4 value = source_at(at);
#if VIEW == 0
    vec3 color = srgb_from_linear(tone_map_aces(value.rgb * frame.exposure));
#elif VIEW == 1
    vec3 color = srgb_from_linear(value.rgb);
#elif VIEW == 2
    vec3 color = value.rgb * 0.5 + 0.5;
    if (value.w <= 0.0) color = vec3(0.0);
#elif VIEW == 3
    // Near is bright; a stop in depth is a sixth of grey, from the farthest thing on.
    float stops = log2(frame.far / max(value.w, 1e-30));
    vec3 color = vec3(value.w > 0.0 ? clamp(stops / 6.0, 0.02, 1.0) : 0.0);
#elif VIEW == 4
    const vec3 COLORS[4] = vec3[4](vec3(0.9, 0.3, 0.2), vec3(0.3, 0.8, 0.3), vec3(0.25, 0.45, 0.95), vec3(0.95, 0.85, 0.3));
    vec3 color = COLORS[int(value.x) & 3];
#elif VIEW == 5
    vec3 color = vec3(0.5 + value.xy * 20.0, 0.5);
#elif VIEW == 7
    vec3 color = vec3(log2(1.0 + value.w) / 8.0);   // white is 255, the 32 of a long mean are two thirds
#else
    vec3 color = vec3(value.w);
#endif
    out_display = vec4(color, 1.0);
}
