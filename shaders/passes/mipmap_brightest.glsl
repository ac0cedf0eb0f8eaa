// Surface of the pixel, within each texel, that sends the most light, or nearly so: of the four finer texels the one with the
// most radiance has it.
#include "lib/lobe.glsl"

void shade(ivec2 px) {
    ivec2 last = size_radiance() - 1, brightest = min(px * 2, last);
    float most = -1.0;
    for (int c = 0; c < 4; ++c) {
        ivec2 at = px * 2 + ivec2(c & 1, c >> 1);
        float light = all(lessThanEqual(at, last)) ? lobe_weight(load_radiance(at)) : -1.0;
        if (light > most) {
            most = light;
            brightest = at;
        }
    }
    out_brightest = load_finer(brightest);
}
