// One level of the pyramid from the finer one. Each texel takes the surface of one of its four finer texels: the one
// that they and their neighbours support most. MIP_FILTER: 0 vote, 1 nearest, 2 average.

#if MIP_FILTER == 0
#include "lib/vote.glsl"
#endif

void shade(ivec2 px) {
    ivec2 last = size_surface() - 1;
    ivec2 base = px * 2;
#if MIP_FILTER == 0
    vote(Block(base, last, frame.ray_scale * texel), out_surface, out_winner);
#elif MIP_FILTER == 1
    out_surface = load_surface(base);
    out_winner = 0u;
#else
    vec3 normal = vec3(0.0);
    float depth = 0.0, count = 0.0;
    for (int c = 0; c < 4; ++c) {
        Surface s = load_surface(min(base + ivec2(c & 1, c >> 1), last));
        if (s.view_depth > 0.0) {
            normal += s.normal;
            depth += s.view_depth;
            count += 1.0;
        }
    }
    float squared = dot(normal, normal);
    out_surface = count > 0.0 && squared > 1e-6 ? Surface(depth / count, normal * inversesqrt(squared), 1.0)
                                                : load_surface(base);
    out_winner = 0u;
#endif
}
