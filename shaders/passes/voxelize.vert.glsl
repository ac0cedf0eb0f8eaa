// The scene as the G-buffer sees it, on the texels of a coarser level.
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
uniform vec2 covered;       // share of the level's texels that the image covers: at odd sizes the last one hangs over

void main() {
    vec4 position_ws = vec4(fetch_transform(objects, object_material.x, 0) * vec4(position, 1.0), 1.0);
    vec4 clip = frame.clip_from_view * vec4((frame.view_from_world * position_ws).xyz, 1.0);
    // z = 0 lies between the clip planes whatever the depth: what is nearer than the near plane counts, too
    gl_Position = vec4(clip.xy * covered + (covered - 1.0) * clip.w, 0.0, clip.w);
#ifdef ALPHA_MASK
    uv = texcoords;
    vertex_alpha = color.a;
    material_row = object_material.y;
#endif
}
