// What surfaces send on of the light that reached them.

const float PI = 3.141592653589793;

void shade(ivec2 px) {
    out_bounce_radiance = load_albedo(px).rgb * load_upsample(px) * (1.0 / PI);
}
