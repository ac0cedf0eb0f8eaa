// One level of the pyramid from the finer one. Each texel takes the surface of one of its four finer texels: the one
// that its 4x4 neighbourhood supports most. MIP_FILTER: 0 vote, 1 nearest, 2 average.

#if MIP_FILTER == 0
// The four finer texels of a block, component by component, so that one neighbour is compared with all at once.
struct Candidates {
    vec4 normal_x, normal_y, normal_z;
    vec4 offset;            // of the tangent plane: dot(normal, position)
    vec4 depth;             // 0: background
    vec4 nearness;          // 1 / (REACH * view depth)
};

// Distance to the tangent plane at which a neighbour counts a quarter, relative to the view depth: of all lengths in
// here, so that the scene's scale does not matter.
const float REACH = 0.15;

// Share of its own footprint that a finer texel's surface has. So the largest surface of the whole footprint wins, not
// the largest of the last few texels, and a near tie is rare.
float votes(ivec2 at) {
#ifdef HAS_FINER_WINNER
    return float(load_finer_winner(at) >> 2u) * (1.0 / 63.0);
#else
    return 1.0;
#endif
}

// How far a voter, with its normal and position, lies on each candidate's surface: by the agreement of normals and the
// closeness to the tangent plane, s = f^1.25 / (1 + u)^2. Mild, since bumps of one surface should average out. The
// power of the cosine is a trade: lower is steadier, and rounds the corners off that light one another
// (docs/method/mipmap.md).
vec4 lying_on(Candidates a, vec3 normal, vec3 position) {
    vec4 facing = max(a.normal_x * normal.x + a.normal_y * normal.y + a.normal_z * normal.z, 0.0);
    vec4 off_plane = abs(a.normal_x * position.x + a.normal_y * position.y + a.normal_z * position.z - a.offset);
    vec4 near = 1.0 / (1.0 + off_plane * a.nearness);
    return facing * sqrt(sqrt(facing)) * near * near;
}

// The texels that vote, relative to the block's first: its four, and the eight that share a side with it.
const ivec2 VOTERS[12] = ivec2[](ivec2(0, 0), ivec2(1, 0), ivec2(0, 1), ivec2(1, 1),
                                 ivec2(0, -1), ivec2(1, -1), ivec2(0, 2), ivec2(1, 2),
                                 ivec2(-1, 0), ivec2(-1, 1), ivec2(2, 0), ivec2(2, 1));
#endif

void shade(ivec2 px) {
    ivec2 last = size_surface() - 1;
    ivec2 base = px * 2;

#if MIP_FILTER == 0
    vec2 scale = frame.ray_scale * texel;
    Candidates candidates;
    Surface block[4];
    float nearest = 1e30, farthest = 0.0;
    for (int c = 0; c < 4; ++c) {
        ivec2 at = base + ivec2(c & 1, c >> 1);
        Surface s = load_surface(min(at, last));
        // A texel beyond the edge of an odd level does not exist: it counts as background, not as a copy.
        if (any(greaterThan(at, last))) s.view_depth = 0.0;
        vec2 ray = ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin);
        candidates.normal_x[c] = s.normal.x;
        candidates.normal_y[c] = s.normal.y;
        candidates.normal_z[c] = s.normal.z;
        candidates.offset[c] = dot(s.normal, position_from_ray(ray, s.view_depth));
        candidates.depth[c] = s.view_depth;
        candidates.nearness[c] = 1.0 / (REACH * max(s.view_depth, 1e-30));
        nearest = s.view_depth > 0.0 ? min(nearest, s.view_depth) : nearest;
        farthest = max(farthest, s.view_depth);
        block[c] = s;
    }

    // Each voter supports a candidate by s^4. The weights are a tent that reaches a texel beyond the block on every side,
    // without its corners. Windows of neighbouring blocks overlap, so what moves from one to the next fades over instead of
    // jumping.
    vec2 center = ray_from_pixel(vec2(base) + 1.0, scale, frame.ray_origin);
    vec4 score = vec4(0.0), shares[12];
    vec3 normals[12];
    float depths[12];
    for (int j = 0; j < 12; ++j) {
        ivec2 at = clamp(base + VOTERS[j], ivec2(0), last);
        Surface voter;
        if (j < 4) voter = block[j];
        else voter = load_surface(at);
        vec3 position = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), voter.view_depth);
        float weight = voter.view_depth > 0.0 ? votes(at) * (j < 4 ? 0.15 : 0.05) : 0.0;
        vec4 same = lying_on(candidates, voter.normal, position), support = same * same;
        score += weight * (support * support);
        shares[j] = weight * same;
        normals[j] = voter.normal;
        // Slid along its own tangent plane to the centre of this texel, but never out of the depths that the block has
        float slid = dot(voter.normal, position) / min(dot(voter.normal, vec3(center, -1.0)), -1e-4);
        depths[j] = clamp(slid, nearest, farthest);
    }

    int winner = 0;
    float best = -1.0;
    for (int c = 0; c < 4; ++c) {
        // Equal but for rounding: the first one stays
        if (candidates.depth[c] > 0.0 && score[c] > best * 1.0001) {
            best = score[c];
            winner = c;
        }
    }

    // The winner's surface is kept as all texels that lie on it have it: their mean normal, and their mean depth after
    // each slid. Other surfaces have no weight there, so nothing is invented between them. Without sliding, a slanted
    // surface moves by half a texel at each level, to the same side, since equal scores go to the first.
    vec4 chosen = vec4(equal(ivec4(winner), ivec4(0, 1, 2, 3)));
    float total = 0.0, depth = 0.0;
    vec3 normal = vec3(0.0);
    for (int j = 0; j < 12; ++j) {
        float weight = dot(shares[j], chosen);
        total += weight;
        depth += weight * depths[j];
        normal += weight * normals[j];
    }
    float squared = dot(normal, normal);
    // The share of a lone texel ends as 0: it stays as it is
    out_surface = total > 0.0 && squared > 0.0 ? Surface(depth / total, normal * inversesqrt(squared))
                                               : load_surface(min(base + ivec2(winner & 1, winner >> 1), last));
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
