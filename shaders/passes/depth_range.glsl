// Nearest and farthest depth of 8x8 texels. LAST: of all, with some room, for the slices of the voxels.

vec2 range_at(ivec2 px) {
#ifdef HAS_SURFACE
    float depth = load_surface(px).view_depth;
    return depth > 0.0 ? vec2(depth) : vec2(1e38, 0.0);     // background
#else
    return load_finer(px);
#endif
}

void shade(ivec2 px) {
#ifdef HAS_SURFACE
    ivec2 size = size_surface();
#else
    ivec2 size = size_finer();
#endif
    vec2 range = vec2(1e38, 0.0);
    // side, 8, is a uniform so that compilers keep the loop
    int i = 0;
    do {
        ivec2 at = min(px * side + ivec2(i % side, i / side), size - 1);
        vec2 r = range_at(at);
        range = vec2(min(range.x, r.x), max(range.y, r.y));
    } while (++i < side * side);
#ifdef LAST
    // A wall across the view has one depth, but slices need a thickness
    range = range.y > 0.0 ? range * vec2(0.99, 1.01) : vec2(1.0, 2.0);
#endif
    out_depth_range = range;
}
