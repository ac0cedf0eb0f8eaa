// Sums over the light of unseen surfels: of each of the four texels one level finer.

float sum_at(ivec2 at) {
#ifdef HAS_RADIANCE
    return load_radiance(at).a;
#else
    return dot(load_finer(at), vec4(1.0));
#endif
}

void shade(ivec2 px) {
    ivec2 at = 2 * px;
    out_unseen_sums = vec4(sum_at(at), sum_at(at + ivec2(1, 0)), sum_at(at + ivec2(0, 1)), sum_at(at + ivec2(1, 1)));
}
