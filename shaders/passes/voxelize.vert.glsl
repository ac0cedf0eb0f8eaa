// The scene as the G-buffer sees it, on the texels of a coarser level.
#include "lib/geometry_vertex.glsl"

uniform vec2 covered;       // share of the level's texels that the image covers: at odd sizes the last one hangs over

void main() {
    vec4 clip = frame.clip_from_view * vec4((frame.view_from_world * vertex_position_ws()).xyz, 1.0);
    // z = 0 lies between the clip planes whatever the depth: what is nearer than the near plane counts, too
    gl_Position = vec4(clip.xy * covered + (covered - 1.0) * clip.w, 0.0, clip.w);
    pass_alpha_on();
}
