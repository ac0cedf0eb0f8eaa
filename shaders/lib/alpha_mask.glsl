// Holes of masked materials, for passes that draw nothing but geometry. Without ALPHA_MASK there are none.
#ifdef ALPHA_MASK
#include "lib/material.glsl"
in vec4 uv;
in float vertex_alpha;
flat in int material_row;
uniform sampler2D materials;
#ifdef BASE_COLOR_MAP
uniform sampler2DArray base_color_map;
#endif
#endif

bool is_hole() {
#ifdef ALPHA_MASK
    float alpha = vertex_alpha * texelFetch(materials, ivec2(0, material_row), 0).a;
#ifdef BASE_COLOR_MAP
    float layer = texelFetch(materials, ivec2(3, material_row), 0).y;
    alpha *= sample_map(base_color_map, layer, 0, uv, materials, material_row).a;
#endif
    return alpha < texelFetch(materials, ivec2(2, material_row), 0).w;
#else
    return false;
#endif
}
