// Any target as four floats, for reading it back; from its texel `first` on, where the image begins in it.
#include "lib/as_vec4.glsl"

void shade(ivec2 px) { out_decoded = as_vec4(load_source(px + first)); }
