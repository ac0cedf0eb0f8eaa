// Values whose noise differs in each of 4x4 texels, without it: a cross-bilateral window that sees each of the 16 once.
// Needs `vec4 load_noisy(ivec2 px)`, the read `surface`, and the uniforms `texel` and `window`, its rows: 5.
#include "lib/bilateral.glsl"

vec4 without_noise(ivec2 px, Surface receiver) {
    ivec2 last = size_surface() - 1;
    vec2 scale = frame.ray_scale * texel;
    Plane plane = tangent_plane(receiver, ray_from_pixel(vec2(px) + 0.5, scale, frame.ray_origin));
    Slant slanted = slant(receiver.normal, px, scale);
    vec4 sum = vec4(0.0);
    float total = 0.0;
    int row = 0;
    do {
        for (int x = -2; x <= 2; ++x) {
            ivec2 at = soft_window_tap(px, x, row, last);
            Surface tap = load_surface(at);
            float weight = soft_window_weight(x, row) * agreement(plane, slanted, tap, vec2(at - px));
            sum += load_noisy(at) * weight;
            total += weight;
        }
    } while (++row < window);
    return total > 0.0 ? sum / total : load_noisy(px);
}
