// Depth of the scene as seen from a light.
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
uniform mat4 clip_from_world;

void main() {
    gl_Position = clip_from_world * vec4(fetch_transform(objects, object_material.x, 0) * vec4(position, 1.0), 1.0);
#ifdef ALPHA_MASK
    uv = texcoords;
    vertex_alpha = color.a;
    material_row = object_material.y;
#endif
}
