// One level of the pyramid from the finer one. Each texel takes the surface of one of its four finer texels: the one
// that its 4x4 neighbourhood supports most. MIP_FILTER: 0 vote, 1 nearest, 2 average. LEVELS: also the next one, from what
// a group of threads has just made; groups overlap by a texel on each side.

#ifdef LEVELS
shared uvec2 tile[GROUP];           // as targets store it, so that levels are the same whether made at once or one by one
shared uint tile_winners[GROUP];
bool from_tile = false;             // what is finer is in there

int tile_place(ivec2 at) {
    ivec2 local = ivec2(gl_LocalInvocationID.xy) + at - group_texel();
    return local.x + int(gl_WorkGroupSize.x) * local.y;
}
#endif

// The texel that is `at` on the finer level.
Surface finer_surface(ivec2 at) {
#ifdef LEVELS
    if (from_tile) return decode_surface(tile[tile_place(at)]);
#endif
    return load_surface(at);
}

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
#ifdef LEVELS
    if (from_tile) return float(tile_winners[tile_place(at)] >> 2u) * (1.0 / 63.0);
#endif
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
float lying_on(vec3 candidate, float offset, float nearness, vec3 normal, vec3 position) {
    float facing = max(dot(candidate, normal), 0.0);
    float near = 1.0 / (1.0 + abs(dot(candidate, position) - offset) * nearness);
    return facing * sqrt(sqrt(facing)) * near * near;
}

// s^4, which takes no roots.
vec4 support(Candidates a, vec3 normal, vec3 position) {
    vec4 facing = max(a.normal_x * normal.x + a.normal_y * normal.y + a.normal_z * normal.z, 0.0);
    vec4 off_plane = abs(a.normal_x * position.x + a.normal_y * position.y + a.normal_z * position.z - a.offset);
    vec4 near = 1.0 / (1.0 + off_plane * a.nearness), squared = facing * facing;
    near *= near;
    near *= near;
    return squared * squared * facing * (near * near);
}

// The texels that vote, relative to the block's first: its four, and the eight that share a side with it.
const ivec2 VOTERS[12] = ivec2[](ivec2(0, 0), ivec2(1, 0), ivec2(0, 1), ivec2(1, 1),
                                 ivec2(0, -1), ivec2(1, -1), ivec2(0, 2), ivec2(1, 2),
                                 ivec2(-1, 0), ivec2(-1, 1), ivec2(2, 0), ivec2(2, 1));

struct Voter {
    vec3 normal, position;
    float weight;
};

// number: in VOTERS; own: the surface of one of the block's four.
Voter voter_at(ivec2 at, int number, ivec2 last, Surface own, vec2 scale) {
    at = clamp(at, ivec2(0), last);
    Surface surface = own;
    if (number >= 4) surface = finer_surface(at);
    vec3 position = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), surface.view_depth);
    return Voter(surface.normal, position, surface.view_depth > 0.0 ? votes(at) * (number < 4 ? 0.15 : 0.05) : 0.0);
}
#endif

struct Kept {
    Surface surface;
    uint winner;
};

// last: of the finer level's texels, whose width is `width` level-0 pixels.
Kept keep(ivec2 px, ivec2 last, float width) {
    ivec2 base = px * 2;

#if MIP_FILTER == 0
    vec2 scale = frame.ray_scale * width;
    Candidates candidates;
    Surface block[4];
    float nearest = 1e30, farthest = 0.0;
    for (int c = 0; c < 4; ++c) {
        ivec2 at = base + ivec2(c & 1, c >> 1);
        Surface s = finer_surface(clamp(at, ivec2(0), last));
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
    vec4 score = vec4(0.0);
#ifndef LOAD_AGAIN
    Voter voters[12];
#endif
    for (int j = 0; j < 12; ++j) {
        Voter voter = voter_at(base + VOTERS[j], j, last, block[j & 3], scale);
        score += voter.weight * support(candidates, voter.normal, voter.position);
#ifndef LOAD_AGAIN
        voters[j] = voter;
#endif
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
    vec3 center = vec3(ray_from_pixel(vec2(base) + 1.0, scale, frame.ray_origin), -1.0);
    vec4 mask = vec4(equal(ivec4(winner), ivec4(0, 1, 2, 3)));
    vec3 chosen = vec3(dot(candidates.normal_x, mask), dot(candidates.normal_y, mask), dot(candidates.normal_z, mask));
    float offset = dot(candidates.offset, mask), nearness = dot(candidates.nearness, mask);
    float total = 0.0, depth = 0.0;
    vec3 normal = vec3(0.0);
    for (int j = 0; j < 12; ++j) {
#ifdef LOAD_AGAIN
        Voter voter = voter_at(base + VOTERS[j], j, last, block[j & 3], scale);
#else
        Voter voter = voters[j];
#endif
        float weight = voter.weight * lying_on(chosen, offset, nearness, voter.normal, voter.position);
        // Slid along its own tangent plane to the centre of this texel, but never out of the depths that the block has
        float slid = dot(voter.normal, voter.position) / min(dot(voter.normal, center), -1e-4);
        total += weight;
        depth += weight * clamp(slid, nearest, farthest);
        normal += weight * voter.normal;
    }
    float squared = dot(normal, normal);
    // The share of a lone texel ends as 0: it stays as it is
    Surface surface = total > 0.0 && squared > 0.0
        ? Surface(depth / total, normal * inversesqrt(squared))
        : Surface(dot(candidates.depth, mask), chosen);
    return Kept(surface, uint(winner) | (uint(clamp(total, 0.0, 1.0) * 63.0 + 0.5) << 2));
#elif MIP_FILTER == 1
    return Kept(finer_surface(base), 0u);
#else
    vec3 normal = vec3(0.0);
    float depth = 0.0, count = 0.0;
    for (int c = 0; c < 4; ++c) {
        Surface s = finer_surface(min(base + ivec2(c & 1, c >> 1), last));
        if (s.view_depth > 0.0) {
            normal += s.normal;
            depth += s.view_depth;
            count += 1.0;
        }
    }
    float squared = dot(normal, normal);
    return Kept(count > 0.0 && squared > 1e-6 ? Surface(depth / count, normal * inversesqrt(squared))
                                              : finer_surface(base), 0u);
#endif
}

void shade(ivec2 px) {
    ivec2 last = size_surface() - 1;
    Kept kept = keep(px, last, texel);
    out_surface = kept.surface;
    out_winner = kept.winner;
#ifdef LEVELS
    tile[gl_LocalInvocationIndex] = encode_surface(kept.surface);
    tile_winners[gl_LocalInvocationIndex] = kept.winner;
    barrier();
    from_tile = true;
    if (in_group(px) && ((px.x | px.y) & 1) == 0) {
        kept = keep(px >> 1, last >> 1, texel * 2.0);
        store_surface_1(px >> 1, kept.surface);
        store_winner_1(px >> 1, kept.winner);
    }
#endif
}
