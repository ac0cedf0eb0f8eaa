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

// Sums over the neighbours that share a candidate's surface, for each of the four.
struct Shares {
    vec4 score, total, depth;
    vec4 normal_x, normal_y, normal_z;
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

// Adds a neighbour `b` with its weight. On a candidate's surface it lies by the agreement of normals and the
// closeness to the tangent plane, s = f^1.25 / (1 + u)^2: mild, since bumps of one surface should average out. It supports
// the candidate by s^4. The power of the cosine is a trade: lower is steadier, and rounds the corners off that light one
// another (docs/method/mipmap.md). It is a polynomial here, within 0.005, because roots take CPUs long.
void add(inout Shares shares, Candidates a, Surface b, vec2 ray, vec2 center, float nearest, float farthest,
         float weight) {
    vec3 q = position_from_ray(ray, b.view_depth);
    float slid = clamp(dot(b.normal, q) / min(dot(b.normal, vec3(center, -1.0)), -1e-4), nearest, farthest);
    weight = b.view_depth > 0.0 ? weight : 0.0;
    vec4 facing = max(a.normal_x * b.normal.x + a.normal_y * b.normal.y + a.normal_z * b.normal.z, 0.0);
    vec4 off_plane = abs(a.normal_x * q.x + a.normal_y * q.y + a.normal_z * q.z - a.offset);
    vec4 near = 1.0 / (1.0 + off_plane * a.nearness);
    vec4 same = facing * (0.525 + facing * (0.763 - 0.288 * facing)) * near * near, support = same * same;
    shares.score += weight * (support * support);
    same *= weight;
    shares.total += same;
    shares.depth += same * slid;
    shares.normal_x += same * b.normal.x;
    shares.normal_y += same * b.normal.y;
    shares.normal_z += same * b.normal.z;
}
#endif

void shade(ivec2 px) {
    ivec2 last = size_surface() - 1;
    ivec2 base = px * 2;

#if MIP_FILTER == 0
    vec2 scale = frame.ray_scale * texel;
    Candidates candidates;
    Surface block[4];
    vec2 rays[4];
    float nearest = 1e30, farthest = 0.0;
    for (int c = 0; c < 4; ++c) {
        ivec2 at = base + ivec2(c & 1, c >> 1);
        Surface s = load_surface(min(at, last));
        // A texel beyond the edge of an odd level does not exist: it counts as background, not as a copy.
        if (any(greaterThan(at, last))) s.view_depth = 0.0;
        rays[c] = ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin);
        candidates.normal_x[c] = s.normal.x;
        candidates.normal_y[c] = s.normal.y;
        candidates.normal_z[c] = s.normal.z;
        candidates.offset[c] = dot(s.normal, position_from_ray(rays[c], s.view_depth));
        candidates.depth[c] = s.view_depth;
        candidates.nearness[c] = 1.0 / (REACH * max(s.view_depth, 1e-30));
        nearest = s.view_depth > 0.0 ? min(nearest, s.view_depth) : nearest;
        farthest = max(farthest, s.view_depth);
        block[c] = s;
    }

    // The winner's surface is kept as all texels that lie on it have it: their mean normal, and their mean depth after
    // each slid along its own tangent plane to the centre of this texel, but never out of the depths that the block has.
    // Other surfaces have no weight there, so nothing is invented between them. Without sliding, a slanted surface
    // moves by half a texel at each level, to the same side, since equal scores go to the first.
    // The weights are a tent that reaches a texel beyond the block on every side, without its corners. Windows of
    // neighbouring blocks overlap, so what moves from one to the next fades over instead of jumping.
    vec2 center = ray_from_pixel(vec2(base) + 1.0, scale, frame.ray_origin);
    Shares shares = Shares(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    for (int c = 0; c < 4; ++c) {
        ivec2 at = min(base + ivec2(c & 1, c >> 1), last);
        add(shares, candidates, block[c], rays[c], center, nearest, farthest, votes(at) * 0.15);
    }
    for (int j = 0; j < neighbours; ++j) {
        ivec2 offset = ivec2(j & 1, (j >> 1 & 1) * 3 - 1);
        ivec2 at = clamp(base + (j < 4 ? offset : offset.yx), ivec2(0), last);
        add(shares, candidates, load_surface(at), ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), center,
            nearest, farthest, votes(at) * 0.05);
    }

    int winner = 0;
    float best = -1.0, total = 0.0, depth = 0.0;
    vec3 normal = vec3(0.0);
    for (int c = 0; c < 4; ++c) {
        // Equal but for rounding: the first one stays
        if (candidates.depth[c] > 0.0 && shares.score[c] > best * 1.0001) {
            best = shares.score[c];
            winner = c;
            total = shares.total[c];
            depth = shares.depth[c];
            normal = vec3(shares.normal_x[c], shares.normal_y[c], shares.normal_z[c]);
        }
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
