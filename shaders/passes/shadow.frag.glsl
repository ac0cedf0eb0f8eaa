// Nothing but depth; masked materials leave holes.
#include "lib/alpha_mask.glsl"

void main() {
    if (is_hole()) discard;
}
