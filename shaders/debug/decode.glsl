// Any target as four floats, for reading it back; from its texel `first` on, where the image begins in it.
#include "debug/source.glsl"

void shade(ivec2 px) { out_decoded = source_at(px + first); }
