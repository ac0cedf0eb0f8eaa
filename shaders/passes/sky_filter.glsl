// The share of the sky without the noise of its slices.
vec3 load_noisy(ivec2 px) { return load_sky_noisy(px).rgb; }
#include "lib/denoise.glsl"

void shade(ivec2 px) {
    out_sky = vec4(1.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth <= 0.0) return;
    out_sky = vec4(without_noise(px, receiver), 1.0);
}
