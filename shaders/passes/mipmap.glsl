// One level of the pyramid from the finer one. Each texel takes the depth and normal of one of its four
// finer texels whole: the one that its 4x4 neighbourhood supports most. MIP_FILTER: 0 vote, 1 nearest, 2 average.

// Support of surface `a` at position `p` by its neighbour: agreement of normals times closeness to the
// tangent plane, relative to depth so that the scene's scale does not matter.
float support(Surface a, vec3 p, Surface b, vec3 q) {
    float facing = max(dot(a.normal, b.normal), 0.0);
    facing *= facing;
    facing *= facing;                                           // p = 4
    float off_plane = abs(dot(a.normal, q - p));
    const float SIGMA = 0.01;                                   // of the view depth
    return b.view_depth > 0.0 ? facing * exp2(off_plane * (-1.4427 / SIGMA) / a.view_depth) : 0.0;
}

void shade(ivec2 px) {
    ivec2 last = size_surface() - 1;
    ivec2 base = px * 2;
    vec2 scale = frame.ray_scale * texel;

#if MIP_FILTER == 0
    Surface s[16];
    vec3 p[16];
    for (int i = 0; i < 16; ++i) {
        ivec2 at = clamp(base + ivec2(i & 3, i >> 2) - 1, ivec2(0), last);
        s[i] = load_surface(at);
        p[i] = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), s[i].view_depth);
    }
    int winner = 0;
    float best = -1.0, nearest = 1e30, farthest = 0.0;
    Surface kept = s[5];
    for (int c = 0; c < 4; ++c) {
        int i = 5 + (c & 1) + (c >> 1) * 4;
        // A texel beyond the edge of an odd level is a clamped copy: it must not win over its original.
        bool inside = all(lessThanEqual(base + ivec2(c & 1, c >> 1), last));
        if (s[i].view_depth > 0.0 && inside) {
            nearest = min(nearest, s[i].view_depth);
            farthest = max(farthest, s[i].view_depth);
            float score = 0.0;
            for (int j = 0; j < 16; ++j) if (j != i) score += support(s[i], p[i], s[j], p[j]);
            if (score > best * 1.0001) {
                best = score;
                winner = c;
                kept = s[i];
            }
        }
    }
    // The texel's position is rebuilt at its own centre, half a finer texel from where the winner lay: the winner
    // slides there along its tangent plane, but never out of the depths that the block really has. Without this a
    // slanted surface moves by half a texel at each level, to the same side, since equal scores go to the first.
    vec2 from = ray_from_pixel(vec2(base + ivec2(winner & 1, winner >> 1)) + 0.5, scale, frame.ray_origin);
    vec2 to = ray_from_pixel(vec2(base) + 1.0, scale, frame.ray_origin);
    float ahead = dot(kept.normal, vec3(to, -1.0));
    float slid = kept.view_depth * dot(kept.normal, vec3(from, -1.0)) / (ahead < -1e-4 ? ahead : -1e-4);
    if (kept.view_depth > 0.0) kept.view_depth = clamp(slid, nearest, farthest);
    out_surface = kept;
    out_winner = uint(winner);
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
    out_surface = count > 0.0 && squared > 1e-6 ? Surface(depth / count, normal * inversesqrt(squared))
                                                : load_surface(base);
    out_winner = 0u;
#endif

#if MIP_FILTER == 1
    out_radiance = load_radiance(base);
#else
    vec3 sum = vec3(0.0);
    for (int c = 0; c < 4; ++c) sum += load_radiance(min(base + ivec2(c & 1, c >> 1), last));
    out_radiance = sum * 0.25;
#endif
}
