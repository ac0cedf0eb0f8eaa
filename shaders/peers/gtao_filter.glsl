// Ambient occlusion without the noise of its slices, where irradiance is expected: that of an ambient light of 1.
vec4 load_noisy(ivec2 px) { return load_ambient_noisy(px); }
#include "lib/denoise.glsl"

void shade(ivec2 px) {
    out_upsample = vec3(0.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth > 0.0) out_upsample = without_noise(px, receiver).rgb;
}
