// Any target as four floats, for reading it back.
#include "lib/as_vec4.glsl"

void shade(ivec2 px) { out_decoded = as_vec4(load_source(px)); }
