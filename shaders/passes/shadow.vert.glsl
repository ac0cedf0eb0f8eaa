// Depth of the scene as seen from a light.
#include "lib/geometry_vertex.glsl"

uniform mat4 clip_from_world;

void main() {
    gl_Position = clip_from_world * vertex_position_ws();
    pass_alpha_on();
}
