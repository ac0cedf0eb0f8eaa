// One level of the pyramid from the finer one. Each texel takes the surface of one of its four finer texels: the one
// that its 4x4 neighbourhood supports most. MIP_FILTER: 0 vote, 1 nearest, 2 average.

#if MIP_FILTER == 0
// The four finer texels of a block, component by component, so that one neighbour is compared with all at once.
struct Candidates {
    vec4 normal_x, normal_y, normal_z;
    vec4 offset;            // of the tangent plane: dot(normal, position)
    vec4 falloff;           // of the support with the distance to that plane
};

// Support of each candidate by a neighbour `b` at `q`: agreement of normals times closeness to the tangent plane,
// relative to depth so that the scene's scale does not matter.
vec4 support(Candidates a, Surface b, vec3 q) {
    vec4 facing = max(a.normal_x * b.normal.x + a.normal_y * b.normal.y + a.normal_z * b.normal.z, 0.0);
    facing *= facing;
    facing *= facing;                                           // p = 4
    vec4 off_plane = abs(a.normal_x * q.x + a.normal_y * q.y + a.normal_z * q.z - a.offset);
    return facing * exp2(off_plane * a.falloff);
}

// Votes that a finer texel brings: the share of its own footprint that its surface has. So the largest surface of
// the whole footprint wins, not the largest of the last few texels, and a near tie is rare.
float votes(ivec2 at) {
#ifdef HAS_FINER_WINNER
    return float(load_finer_winner(at) >> 2u) * (1.0 / 63.0);
#else
    return 1.0;
#endif
}

// Weight of the 4x4 neighbour `offset` (0 to 3): a tent that reaches a texel beyond the block on every side. Windows
// of neighbouring blocks overlap, so what moves from one to the next fades over instead of jumping.
float tent(ivec2 offset) {
    return (offset.x == 0 || offset.x == 3 ? 0.125 : 0.375) * (offset.y == 0 || offset.y == 3 ? 0.125 : 0.375);
}
#endif

void shade(ivec2 px) {
    ivec2 last = size_surface() - 1;
    ivec2 base = px * 2;

#if MIP_FILTER == 0
    const float SIGMA = 0.03;                                   // of the view depth
    vec2 scale = frame.ray_scale * texel;
    Surface block[4];
    Candidates candidates;
    vec4 depths;
    for (int c = 0; c < 4; ++c) {
        ivec2 at = base + ivec2(c & 1, c >> 1);
        // A texel beyond the edge of an odd level does not exist: it counts as background, not as a copy.
        bool inside = all(lessThanEqual(at, last));
        block[c] = load_surface(min(at, last));
        if (!inside) block[c].view_depth = 0.0;
        vec3 n = block[c].normal;
        vec3 p = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), block[c].view_depth);
        candidates.normal_x[c] = n.x;
        candidates.normal_y[c] = n.y;
        candidates.normal_z[c] = n.z;
        candidates.offset[c] = dot(n, p);
        candidates.falloff[c] = -1.4427 / (SIGMA * max(block[c].view_depth, 1e-30));
        depths[c] = block[c].view_depth;
    }
    vec4 score = vec4(0.0);
    for (int j = 0; j < neighbours; ++j) {                      // 4x4; each candidate also supports itself, alike
        ivec2 offset = ivec2(j & 3, j >> 2);
        ivec2 at = clamp(base + offset - 1, ivec2(0), last);
        Surface b = load_surface(at);
        vec3 q = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), b.view_depth);
        if (b.view_depth > 0.0) score += votes(at) * tent(offset) * support(candidates, b, q);
    }
    int winner = 0;
    Surface kept = block[0];
    float best = -1.0, nearest = 1e30, farthest = 0.0;
    for (int c = 0; c < 4; ++c) {
        if (depths[c] <= 0.0) continue;
        nearest = min(nearest, depths[c]);
        farthest = max(farthest, depths[c]);
        if (score[c] > best * 1.0001) {                         // equal but for rounding: the first one stays
            best = score[c];
            winner = c;
            kept = block[c];
        }
    }

    // The winner's surface, as all texels that lie on it have it: their mean normal, and their mean depth after each
    // slid along its own tangent plane to the centre of this texel, but never out of the depths that the block has.
    // Other surfaces have no weight here, so nothing is invented between them. Without sliding, a slanted surface
    // moves by half a texel at each level, to the same side, since equal scores go to the first.
    vec2 center = ray_from_pixel(vec2(base) + 1.0, scale, frame.ray_origin);
    vec3 normal = vec3(0.0);
    float depth = 0.0, total = 0.0;
    for (int j = 0; j < neighbours; ++j) {
        ivec2 offset = ivec2(j & 3, j >> 2);
        ivec2 at = clamp(base + offset - 1, ivec2(0), last);
        Surface b = load_surface(at);
        if (b.view_depth <= 0.0 || kept.view_depth <= 0.0) continue;
        vec2 ray = ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin);
        float facing = max(dot(kept.normal, b.normal), 0.0);
        float off_plane = abs(dot(kept.normal, position_from_ray(ray, b.view_depth)) - candidates.offset[winner]);
        // Milder than in the vote: bumps of one surface should average out. The power of the cosine is a trade: lower
        // is steadier, and rounds the corners off that light one another (docs/method/mipmap.md).
        float same = facing * sqrt(sqrt(facing)) * exp2(off_plane * candidates.falloff[winner] * 0.2);
        float weight = same * votes(at) * tent(offset);
        float ahead = dot(b.normal, vec3(center, -1.0));
        float slid = b.view_depth * dot(b.normal, vec3(ray, -1.0)) / (ahead < -1e-4 ? ahead : -1e-4);
        normal += weight * b.normal;
        depth += weight * clamp(slid, nearest, farthest);
        total += weight;
    }
    float squared = dot(normal, normal);
    if (total > 0.0 && squared > 0.0) kept = Surface(depth / total, normal * inversesqrt(squared));
    out_surface = kept;
    out_winner = uint(winner) | (uint(clamp(total, 0.0, 1.0) * 63.0 + 0.5) << 2);
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
}
