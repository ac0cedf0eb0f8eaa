// Bits of a fragment's column, combined with the ones there by a logic operation. SOLID (XOR): all slices whose centres
// lie behind the fragment, so that those between front and back of a body remain. Otherwise (OR): the slices that the
// surface passes within the texel, so that slanted ones have no gaps.
#include "lib/alpha_mask.glsl"
#include "lib/voxels.glsl"

uniform sampler2D depth_range;

float clamped_slice(Slicing slicing, float inverse_depth) {
    return clamp(slice_at(slicing, 1.0 / inverse_depth), -1.0, float(SLICES) + 1.0);
}

void main() {
    Slicing slicing = make_slicing(texelFetch(depth_range, ivec2(0), 0).xy);
    float inverse_depth = gl_FragCoord.w;       // linear in the image
#ifdef SOLID
    int first = int(floor(clamped_slice(slicing, inverse_depth) + 0.5)), last = SLICES - 1;
#else
    float span = min(0.5 * fwidth(inverse_depth), 0.5 * inverse_depth);
    int first = int(floor(clamped_slice(slicing, inverse_depth + span)));
    int last = int(floor(clamped_slice(slicing, inverse_depth - span)));
#endif
    out_voxels = slice_bits(first, last);
#if SLICES > 128
    out_voxels_far = slice_bits(first - 128, last - 128);
#endif
    store_outputs();
    if (is_hole()) discard;     // last: the lookup and the span take derivatives from neighbours
}
