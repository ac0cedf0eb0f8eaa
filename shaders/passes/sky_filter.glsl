// The share of the sky without the noise of its slices: their rotation repeats every four texels, and this window sees each
// of the 16 once, whatever its phase.
#include "lib/bilateral.glsl"

void shade(ivec2 px) {
    out_sky = vec4(1.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth <= 0.0) return;
    ivec2 last = size_surface() - 1;
    vec2 scale = frame.ray_scale * texel;
    vec3 p = position_from_ray(ray_from_pixel(vec2(px) + 0.5, scale, frame.ray_origin), receiver.view_depth);
    vec3 sum = vec3(0.0);
    float total = 0.0;
    for (int i = 0; i < window; ++i) {
        ivec2 offset = ivec2(i % 5, i / 5) - 2;
        ivec2 at = clamp(px + offset, ivec2(0), last);
        Surface tap = load_surface(at);
        float weight = (abs(offset.x) == 2 ? 0.5 : 1.0) * (abs(offset.y) == 2 ? 0.5 : 1.0)
                     * agreement(receiver, p, tap, ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin));
        sum += load_sky_noisy(at).rgb * weight;
        total += weight;
    }
    out_sky = vec4(total > 0.0 ? sum / total : load_sky_noisy(px).rgb, 1.0);
}
