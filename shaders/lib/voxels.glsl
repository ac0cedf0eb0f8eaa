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

// End of a segment: a point on a visible surface, and the plane of that surface, which must not block its own light.
// The reciprocal of depth is linear in the image, on planes and along segments.
struct VoxelEnd {
    ivec2 px;
    vec3 position;
    float inverse_depth;
    vec3 plane;             // normal over the camera's distance from the plane
    float thickness;        // reciprocal depths that the plane takes up in a texel, and one slice
};

// position, normal: view space. texel_size: of the level, on the plane z = 1.
VoxelEnd voxel_end(Slicing slicing, ivec2 px, vec3 position, vec3 normal, vec2 texel_size) {
    vec3 plane = normal / max(-dot(normal, position), 0.01 * length(position));
    float inverse_depth = 1.0 / -position.z;
    return VoxelEnd(px, position, inverse_depth, plane,
                    dot(abs(plane.xy), texel_size) + inverse_depth * (exp2(1.0 / slicing.per_octave) - 1.0));
}

// Texels from the middle of an end's own one that the walk leaves out at least. Measured against ray casting in
// docs/method/voxelize.md: with 0.5, its own texel alone, coarse texels, which hold more than one surface, shadow themselves.
const float END_TEXELS = 1.5;

// Share of the way to another point after which the segment has left its own end's plane.
float way_off(VoxelEnd end, VoxelEnd other) {
    float height = abs(dot(end.plane, other.position - end.position)) * other.inverse_depth;    // over the plane
    return end.thickness < height ? end.thickness / height : 1.0;
}

// Whether something lies between two ends. Walks one texel for each step along the longer side of the way, but for the
// texels of its ends. far_grid: the second texture; any if there are 128 slices.
bool voxels_block(usampler2D grid, usampler2D far_grid, Slicing slicing, VoxelEnd start, VoxelEnd end) {
    ivec2 way = end.px - start.px;
    // Without abs(), which some drivers of Intel get wrong for integers
    ivec2 steps_along = max(way, -way);
    int count = max(steps_along.x, steps_along.y);
    float unit = 1.0 / float(max(count, 1));
    // Texel i is crossed from (i - 1/2) to (i + 1/2) steps
    float steps = float(count);
    float first = max(way_off(start, end) * steps, END_TEXELS);
    float last = steps - max(way_off(end, start) * steps, END_TEXELS);
    float change = (end.inverse_depth - start.inverse_depth) * unit;
    float zero = -slicing.log_near * slicing.per_octave;
    vec2 stride = vec2(way) * unit, center = vec2(start.px) + 0.5;
    float i = floor(first + 0.5);
    int slice = int(floor(zero - log2(start.inverse_depth + change * first) * slicing.per_octave));
    if (i - 0.5 < last) do {
        int ahead = int(floor(zero - log2(start.inverse_depth + change * min(i + 0.5, last)) * slicing.per_octave));
        int low = min(slice, ahead), high = max(slice, ahead);
        ivec2 at = ivec2(center + stride * i);
        uvec4 hit = texelFetch(grid, at, 0) & slice_bits(low, high);
#if SLICES > 128
        hit |= texelFetch(far_grid, at, 0) & slice_bits(low - 128, high - 128);
#endif
        if ((hit.x | hit.y | hit.z | hit.w) != 0u) return true;
        slice = ahead;
        i += 1.0;
    } while (i - 0.5 < last);
    return false;
}
