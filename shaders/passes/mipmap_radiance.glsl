// One level of radiance from the finer one. NEAREST: the first texel of each block, as the surfaces do then.
// LEVELS_AT_ONCE: also as many more as a group's texels have.

#ifdef LEVELS_AT_ONCE
shared uint tile[GROUP_THREADS];    // as a target stores it, so that levels are the same whether made at once or one by one

// The texel `up` levels above a group's, of the four below it. False where another thread makes it; every thread calls it.
bool make_coarser(ivec2 px, int up, out vec3 radiance) {
    barrier();
    if (((px.x | px.y) & ((1 << up) - 1)) != 0) return false;
    int place = int(gl_LocalInvocationIndex);
    radiance = decode_rgb9e5(tile[place]);
#ifndef NEAREST
    int right = 1 << (up - 1), above = right * int(gl_WorkGroupSize.x);
    radiance += decode_rgb9e5(tile[place + right]);
    radiance += decode_rgb9e5(tile[place + above]);
    radiance += decode_rgb9e5(tile[place + right + above]);
    radiance *= 0.25;
#endif
    tile[place] = encode_rgb9e5(radiance);
    return true;
}
#endif

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
#ifdef LEVELS_AT_ONCE
    tile[gl_LocalInvocationIndex] = encode_rgb9e5(out_radiance);
    vec3 radiance;
    if (make_coarser(px, 1, radiance)) store_radiance_1(px >> 1, radiance);
#if LEVELS_AT_ONCE > 2
    if (make_coarser(px, 2, radiance)) store_radiance_2(px >> 2, radiance);
#endif
#if LEVELS_AT_ONCE > 3
    if (make_coarser(px, 3, radiance)) store_radiance_3(px >> 3, radiance);
#endif
#if LEVELS_AT_ONCE > 4
    if (make_coarser(px, 4, radiance)) store_radiance_4(px >> 4, radiance);
#endif
#endif
}
