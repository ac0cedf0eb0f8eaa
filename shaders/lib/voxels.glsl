// Voxels of the view frustum: each texel is a column of SLICES depth slices, one bit each. Slice 128 h + 32 c + b is
// bit b of component c; h is 0 in the first texture, 1 in the second, which exists for 256 slices.
#ifndef SLICES
#define SLICES 128
#endif

// Slices are evenly spaced in the logarithm of view depth: slice k covers the coordinates k to k + 1.
struct Slicing {
    float log_near;
    float per_octave;
};

// range: nearest and farthest depth.
Slicing make_slicing(vec2 range) {
    float log_near = log2(range.x);
    return Slicing(log_near, float(SLICES) / (log2(range.y) - log_near));
}

float slice_at(Slicing slicing, float view_depth) { return (log2(view_depth) - slicing.log_near) * slicing.per_octave; }

// Bits of the slices from `slice` on.
uvec4 slices_from(int slice) {
    ivec4 shift = clamp(slice - ivec4(0, 32, 64, 96), 0, 32);
    ivec4 part = shift >> 1;
    return (uvec4(0xFFFFFFFFu) << part) << (shift - part);      // a shift by 32 at once is undefined
}

// Bits of the slices first to last, both included; none if there is no such slice among these 128.
uvec4 slice_bits(int first, int last) { return slices_from(first) & ~slices_from(last + 1); }

// End of a segment. Both ends are visible surfaces, so what is nearer along their view rays is free: they are moved
// towards the camera by one slice, and by as much as their own plane comes nearer over one texel. The reciprocal of
// depth is linear in the image, on planes and along segments.
struct VoxelEnd {
    ivec2 px;
    float inverse_depth;
};

// position, normal: view space. texel_size: of the level, on the plane z = 1.
VoxelEnd voxel_end(Slicing slicing, ivec2 px, vec3 position, vec3 normal, vec2 texel_size) {
    float facing = max(-dot(normal, position), 0.01 * length(position));
    float slope = dot(abs(normal.xy), texel_size) / facing;
    return VoxelEnd(px, exp2(1.0 / slicing.per_octave) / -position.z + slope);
}

// Whether something lies between two ends. Walks the texels that the segment touches but for those of its ends.
// far_grid: the second texture; any if there are 128 slices.
bool voxels_block(usampler2D grid, usampler2D far_grid, Slicing slicing, VoxelEnd start, VoxelEnd end) {
    ivec2 way = end.px - start.px, count = abs(way), stride = sign(way);
    // The k-th crossing of a border across x lies at (2 k + 1) / (2 |x|) of the way: whole numbers tell which is next
    vec2 unit = 0.5 / vec2(max(count, 1));
    ivec2 crossing = ivec2(1), at = start.px;
    float change = end.inverse_depth - start.inverse_depth;
    float zero = -slicing.log_near * slicing.per_octave;
    int slice = -1;
    bool inside = false;
    while (true) {
        ivec2 order = crossing * count.yx;
        bvec2 next = lessThanEqual(order, order.yx);
        float t = next.x ? float(crossing.x) * unit.x : float(crossing.y) * unit.y;
        int ahead = int(floor(zero - log2(start.inverse_depth + change * t) * slicing.per_octave));
        if (inside) {
            int low = min(slice, ahead), high = max(slice, ahead);
            uvec4 hit = texelFetch(grid, at, 0) & slice_bits(low, high);
#if SLICES > 128
            hit |= texelFetch(far_grid, at, 0) & slice_bits(low - 128, high - 128);
#endif
            if ((hit.x | hit.y | hit.z | hit.w) != 0u) return true;
        }
        at += stride * ivec2(next);
        if (at == end.px) return false;
        crossing += 2 * ivec2(next);
        slice = ahead;
        inside = true;
    }
    return false;
}
