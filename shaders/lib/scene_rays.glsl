// Rays against the scene's triangles, in world space. Needs RAY_TABLES and RAY_UNIFORMS of passes/rays.py. MASKED: some
// triangles have holes.
//   extent: of the scene, metres.
#include "lib/triangle_tree.glsl"

const float RAY_LIFT = 3e-4;     // share of the view depth by which rays stand off their surface: LIFT of scene/triangles.py

vec3 to_world(vec3 position) { return (frame.world_from_view * vec4(position, 1.0)).xyz; }

// Whether a triangle lies between two points.
bool is_blocked(vec3 from, vec3 to) {
    return triangles_block(texture_nodes, texture_triangles,
#ifdef MASKED
                           texture_corners, texture_masks, texture_alphas,
#endif
                           node_count, from, to);
}

// What a ray as long as `along` meets first.
Met first_met(vec3 from, vec3 along) {
    return nearest_triangle(texture_nodes, texture_triangles,
#ifdef MASKED
                            texture_corners, texture_masks, texture_alphas,
#endif
                            node_count, from, along);
}
