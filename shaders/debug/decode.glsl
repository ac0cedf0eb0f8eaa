// Any target as four floats, for reading it back.
#include "debug/source.glsl"

void shade(ivec2 px) { out_decoded = source_at(px); }
