// Vertices for passes that draw nothing but geometry; ALPHA_MASK: with what lib/alpha_mask.glsl needs.
#include "lib/scene.glsl"

in vec3 position;
#ifdef ALPHA_MASK
in vec4 texcoords;
in vec4 color;
out vec4 uv;
out float vertex_alpha;
flat out int material_row;
#endif
in ivec2 object_material;

uniform sampler2D objects;

vec4 vertex_position_ws() {
    return vec4(fetch_transform(objects, object_material.x, 0) * vec4(position, 1.0), 1.0);
}

void pass_alpha_on() {
#ifdef ALPHA_MASK
    uv = texcoords;
    vertex_alpha = color.a;
    material_row = object_material.y;
#endif
}
