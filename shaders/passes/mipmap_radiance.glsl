// One level of radiance from the finer one. NEAREST: the first texel of each block, as the surfaces do then.

void shade(ivec2 px) {
    ivec2 base = px * 2;
#ifdef NEAREST
    out_radiance = load_radiance(base);
#else
    ivec2 last = size_radiance() - 1;
    vec3 sum = vec3(0.0);
    for (int c = 0; c < 4; ++c) {
        ivec2 at = base + ivec2(c & 1, c >> 1);
        // Beyond the edge of an odd level there is no light: the texel sends what its part inside the image does.
        if (all(lessThanEqual(at, last))) sum += load_radiance(at);
    }
    out_radiance = sum * 0.25;
#endif
}
