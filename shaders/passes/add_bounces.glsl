// Irradiance of all bounces.

void shade(ivec2 px) {
    vec3 sum = load_upsample(px) + load_upsample_2(px);
#ifdef HAS_UPSAMPLE_3
    sum += load_upsample_3(px);
#endif
#ifdef HAS_UPSAMPLE_4
    sum += load_upsample_4(px);
#endif
    out_all_bounces = sum;
}
