// The vote of a block of four texels for the surface that the texel of the next level has (docs/method/mipmap.md).
// Needs the targets `surface` and, but for the image's own level, `finer_winner`; uniforms `finer_is_voted`: that is there;
// `mirrored`: see `voter_place`.

// Distance to the tangent plane at which a texel counts a quarter in the mean and 1/256 in the vote. Relative to the view depth,
// so that the scene's scale does not matter.
const float REACH = 0.15;

// A block of four texels. at: its first one. last: the last one of its level. scale: size of a texel on the plane z = 1.
struct Block {
    ivec2 at, last;
    vec2 scale;
};

// A texel that votes.
struct Voter {
    vec3 normal, position;
    float votes;            // 0: background
};

// A block's four texels, component by component, so that one voter is compared with all at once.
struct Candidates {
    vec4 normal_x, normal_y, normal_z;
    vec4 x, y, depth;       // depth 0: background
    vec4 offset;            // of the tangent plane: dot(normal, position)
    vec4 nearness;          // 1 / (REACH * view depth)
};

// Written out instead of a loop: compilers for GPUs may keep one whose body is long, and then the array that it reads in memory.
#define FOR_VOTERS(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7)

// Place of a voter relative to the block's first texel: the four, then one beyond each side, (0, -1), (2, 0), (1, 2) and (-1, 1),
// a pinwheel, which turns the other way at every other level. So windows of neighbouring blocks overlap, and what moves from one
// to the next fades over instead of jumping; and all texels have as many votes, as each is beyond a side of just one other block.
// Beyond the image lie copies of the texels at its edge. By shifts, since compilers keep tables in memory, too.
ivec2 voter_place(int j) {
    ivec2 place = ((ivec2(0x2D99, 0xB4A5) >> (2 * j)) & 3) - 1;
    if (j > 3 && mirrored) place.x = 1 - place.x;
    return place;
}

// Share of its own footprint that a finer texel's surface has. So the largest surface of the whole footprint wins, not
// the largest of the last few texels, and a near tie is rare.
float load_votes(ivec2 at) {
#ifdef HAS_FINER_WINNER
    if (finer_is_voted) return float(load_finer_winner(at) >> 2u) * (1.0 / 63.0);
#endif
    return 1.0;
}

Voter load_voter(Block block, int j) {
    ivec2 place = block.at + voter_place(j), at = clamp(place, ivec2(0), block.last);
    Surface s = load_surface(at);
    float votes = load_votes(at);
    // Of the block itself a texel beyond the edge of an odd level does not exist: it counts as background, not as a copy
    if (j < 4 && any(greaterThan(place, block.last))) s.view_depth = 0.0;
    vec2 ray = ray_from_pixel(vec2(at) + 0.5, block.scale, frame.ray_origin);
    return Voter(s.normal, position_from_ray(ray, s.view_depth), s.view_depth > 0.0 ? votes : 0.0);
}

Candidates candidates_of(Voter a, Voter b, Voter c, Voter d) {
    vec4 normal_x = vec4(a.normal.x, b.normal.x, c.normal.x, d.normal.x);
    vec4 normal_y = vec4(a.normal.y, b.normal.y, c.normal.y, d.normal.y);
    vec4 normal_z = vec4(a.normal.z, b.normal.z, c.normal.z, d.normal.z);
    vec4 x = vec4(a.position.x, b.position.x, c.position.x, d.position.x);
    vec4 y = vec4(a.position.y, b.position.y, c.position.y, d.position.y);
    vec4 depth = -vec4(a.position.z, b.position.z, c.position.z, d.position.z);
    return Candidates(normal_x, normal_y, normal_z, x, y, depth, normal_x * x + normal_y * y - normal_z * depth,
                      1.0 / (REACH * max(depth, 1e-30)));
}

// All candidates face as the first one does, to 11 degrees, and lie on its plane, to 0.3 % of the view depth: those who vote for
// one vote for all, so that it does not matter which is taken. A GPU skips the count where that is true of whole groups.
bool on_one_surface(Candidates a) {
    vec4 facing = a.normal_x * a.normal_x.x + a.normal_y * a.normal_y.x + a.normal_z * a.normal_z.x;
    vec4 off_plane = abs(a.x * a.normal_x.x + a.y * a.normal_y.x - a.depth * a.normal_z.x - a.offset.x) * a.nearness;
    return all(greaterThan(facing, vec4(0.98))) && all(lessThan(off_plane, vec4(0.02)));
}

// The agreement f of normals and the distance u to the tangent plane say how much a voter lies on a surface: f^1.5 / (1 + u)^2.
// Mild, since bumps of one surface should average out. The power of the cosine is a trade: lower is steadier, and rounds the
// corners off that light one another.
float lying_on(vec3 normal, float offset, float nearness, Voter v) {
    float facing = max(dot(normal, v.normal), 0.0), far = 1.0 + abs(dot(normal, v.position) - offset) * nearness;
    return facing * sqrt(facing) / (far * far);
}

// How much voters support candidates: f^5 / (1 + u)^8. above: their height over the tangent planes.
vec4 support(Candidates a, vec4 facing, vec4 above) {
    vec4 near = 1.0 / (1.0 + abs(above) * a.nearness), once = facing * (near * near), twice = once * once;
    return facing * (twice * twice);
}

vec4 support(Candidates a, Voter v) {
    vec4 facing = max(a.normal_x * v.normal.x + a.normal_y * v.normal.y + a.normal_z * v.normal.z, 0.0);
    vec4 above = a.normal_x * v.position.x - a.offset + a.normal_y * v.position.y + a.normal_z * v.position.z;
    return v.votes * support(a, facing, above);
}

// How much the candidates support one another, and each itself. votes: theirs. Of each two the agreement of the normals is the same both ways.
vec4 mutual_support(Candidates a, vec4 votes) {
    vec4 next = max(a.normal_x * a.normal_x.yzwx + a.normal_y * a.normal_y.yzwx + a.normal_z * a.normal_z.yzwx, 0.0);
    vec2 across = max(a.normal_x.xy * a.normal_x.zw + a.normal_y.xy * a.normal_y.zw + a.normal_z.xy * a.normal_z.zw, 0.0);
#define ABOVE(turn) (a.normal_x * a.x.turn - a.offset + a.normal_y * a.y.turn - a.normal_z * a.depth.turn)
    return votes + votes.yzwx * support(a, next, ABOVE(yzwx)) + votes.zwxy * support(a, across.xyxy, ABOVE(zwxy))
         + votes.wxyz * support(a, next.wxyz, ABOVE(wxyz));
#undef ABOVE
}

// What a score must be above to win over another: equal but for rounding, the first one stays.
float better_than(float score) { return score + 1e-4 * abs(score); }

// Which candidate wins. score: negative for background.
int winner_of(vec4 score) {
    int winner = score.y > better_than(score.x) ? 1 : 0;
    float best = winner == 1 ? score.y : score.x;
    if (score.z > better_than(best)) {
        winner = 2;
        best = score.z;
    }
    return score.w > better_than(best) ? 3 : winner;
}

// What voters add up to.
struct Mean {
    vec3 normal;
    float depth, total;
};

void join(inout Mean mean, Voter v, float share, vec3 center, float nearest, float farthest) {
    mean.total += share;
    mean.depth += share * clamp(dot(v.normal, v.position) / min(dot(v.normal, center), -1e-4), nearest, farthest);
    mean.normal += share * v.normal;
}

// The surface of the texel above the block, and the winner: which of the four, x + 2 y, and in the upper six bits the share of
// the footprint that lies on its surface.
void vote(Block block, out Surface surface, out uint winner) {
    Voter voters[8];
#define LOAD(j) voters[j] = load_voter(block, j);
    FOR_VOTERS(LOAD)
    Candidates candidates = candidates_of(voters[0], voters[1], voters[2], voters[3]);
    vec4 score = vec4(0.0);
    if (!on_one_surface(candidates)) {
        score = mutual_support(candidates, vec4(voters[0].votes, voters[1].votes, voters[2].votes, voters[3].votes))
              + support(candidates, voters[4]) + support(candidates, voters[5])
              + support(candidates, voters[6]) + support(candidates, voters[7]);
    }
    bvec4 exists = greaterThan(candidates.depth, vec4(0.0));
    int chosen = winner_of(mix(vec4(-1.0), score, exists));

    // The winner's surface is kept as all texels that lie on it have it: their mean normal, and their mean depth after
    // each slid along its own tangent plane to the centre of this texel, but never out of the depths that the block has.
    // Other surfaces have no weight there, so nothing is invented between them. Without sliding, a slanted
    // surface moves by half a texel at each level, to the same side, since equal scores go to the first.
    vec4 only = vec4(equal(ivec4(chosen), ivec4(0, 1, 2, 3)));
    vec3 its_normal = vec3(dot(candidates.normal_x, only), dot(candidates.normal_y, only), dot(candidates.normal_z, only));
    float its_offset = dot(candidates.offset, only), its_nearness = dot(candidates.nearness, only);
    vec2 nearest_two = min(mix(vec2(1e30), candidates.depth.xy, exists.xy), mix(vec2(1e30), candidates.depth.zw, exists.zw));
    vec2 farthest_two = max(candidates.depth.xy, candidates.depth.zw);
    float nearest = min(nearest_two.x, nearest_two.y), farthest = max(farthest_two.x, farthest_two.y);
    vec3 center = vec3(ray_from_pixel(vec2(block.at) + 1.0, block.scale, frame.ray_origin), -1.0);
    Mean mean = Mean(vec3(0.0), 0.0, 0.0);
#define SHARE(j) voters[j].votes * lying_on(its_normal, its_offset, its_nearness, voters[j])
#define JOIN(j) join(mean, voters[j], SHARE(j), center, nearest, farthest);
    FOR_VOTERS(JOIN)
    float squared = dot(mean.normal, mean.normal);
    // The share of a lone texel ends as 0: it stays as it is
    float share = clamp(mean.total * 0.125, 0.0, 1.0);
    surface = mean.total > 0.0 && squared > 0.0 ? Surface(mean.depth / mean.total, mean.normal * inversesqrt(squared), share * share)
                                                : Surface(dot(candidates.depth, only), its_normal, 0.0);
    winner = uint(chosen) | (uint(share * 63.0 + 0.5) << 2);
}
