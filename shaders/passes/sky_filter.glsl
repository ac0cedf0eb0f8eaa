// The shares of the sky without the noise of their slices: a filter over the texels in which they differ and, where nothing has
// moved since the last frame, a running mean.
vec4 load_noisy(ivec2 px) { return load_sky_noisy(px); }
#include "lib/denoise.glsl"

const float LONGEST = 32.0;     // twice the turns that the slices take

void shade(ivec2 px) {
    out_sky = vec4(1.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth <= 0.0) return;
    vec4 shares = without_noise(px, receiver);
#ifdef HAS_SKY_HISTORY
    if (frame.unmoved > 0) shares = mix(load_sky_history(px), shares, 1.0 / min(float(frame.unmoved) + 1.0, LONGEST));
#endif
    out_sky = shares;
}
