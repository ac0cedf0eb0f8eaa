// Bits of a fragment's column, combined with the ones there by a logic operation. SOLID (XOR): all slices whose centres
// lie behind the fragment, so that those between front and back of a body remain. Otherwise (OR): the slice that the
// fragment lies in.
#include "lib/alpha_mask.glsl"
#include "lib/voxels.glsl"

uniform sampler2D depth_range;

void main() {
    if (is_hole()) discard;
    float at = slice_at(make_slicing(texelFetch(depth_range, ivec2(0), 0).xy), 1.0 / gl_FragCoord.w);
    at = clamp(at, -1.0, float(SLICES) + 1.0);
#ifdef SOLID
    int first = int(floor(at + 0.5)), last = SLICES - 1;
#else
    int first = int(floor(at)), last = first;
#endif
    out_voxels = slice_bits(first, last);
#if SLICES > 128
    out_voxels_far = slice_bits(first - 128, last - 128);
#endif
    store_outputs();
}
