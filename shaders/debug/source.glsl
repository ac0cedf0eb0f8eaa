// The looked-at target as four floats.
#include "lib/as_vec4.glsl"

vec4 source_at(ivec2 px) {
#if defined(HAS_MORE)
    return as_vec4(load_source(px), load_more(px), frame.voxel_view_slice);
#elif defined(VOXELS)
    return as_vec4(load_source(px), frame.voxel_view_slice);
#else
    return as_vec4(load_source(px));
#endif
}
