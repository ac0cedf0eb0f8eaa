// The share of the sky without the noise of its slices: a filter over the texels in which they differ and, where nothing has
// moved since the last frame, a running mean. alpha: frames in it.
vec3 load_noisy(ivec2 px) { return load_sky_noisy(px).rgb; }
#include "lib/denoise.glsl"

const float LONGEST = 32.0;     // twice the turns that the slices take

void shade(ivec2 px) {
    out_sky = vec4(1.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth <= 0.0) return;
    vec3 share = without_noise(px, receiver);
    float frames = 1.0;
#ifdef HAS_SKY_HISTORY
    if (frame.unmoved == 1) {
        vec4 mean = load_sky_history(px);
        frames = min(mean.a + 1.0, LONGEST);
        share = mix(mean.rgb, share, 1.0 / frames);
    }
#endif
    out_sky = vec4(share, frames);
}
