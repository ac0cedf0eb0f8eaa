// What surfaces send on of the light that reached them.
#include "lib/pi.glsl"

void shade(ivec2 px) {
    out_bounce_radiance = load_albedo(px).rgb * load_upsample(px) * (1.0 / PI);
}
