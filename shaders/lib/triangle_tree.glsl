// Rays against the triangles of a scene: what scene/triangle_tree.py builds and gpu/triangle_tables.py uploads.
// Tables are rows of TABLE_WIDTH texels. MASKED: some triangles have holes.

#include "lib/float_table.glsl"

const int TABLE_BITS = 12;
const int TABLE_WIDTH = 1 << TABLE_BITS;

ivec2 table_place(int index) { return ivec2(index & (TABLE_WIDTH - 1), index >> TABLE_BITS); }

vec4 fetch_row_major(FLOAT_TABLE table, int index) { return FLOAT_TEXEL(table, table_place(index)); }

// Where a ray from `from` along `along` meets a triangle: (distance over the length of `along`, barycentric u, v).
// A third below 0: it does not. Edges belong to both of their triangles, so that no ray slips through between them.
// Source: Moeller and Trumbore 1997.
vec3 meet_triangle(vec3 from, vec3 along, vec3 corner, vec3 edge_u, vec3 edge_v) {
    const float EDGE = 1e-6;
    const vec3 MISSED = vec3(0.0, 0.0, -1.0);
    vec3 p = cross(along, edge_v);
    float determinant = dot(edge_u, p);
    if (determinant == 0.0) return MISSED;
    float inverse = 1.0 / determinant;
    vec3 offset = from - corner;
    float u = dot(offset, p) * inverse;
    vec3 q = cross(offset, edge_u);
    float v = dot(along, q) * inverse;
    float at = dot(edge_v, q) * inverse;
    bool hit = u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE && at > 0.0 && at < 1.0;
    return hit ? vec3(at, u, max(v, 0.0)) : MISSED;
}

#ifdef MASKED
int wrapped_texel(float coordinate, int count, int wrap) {
    int texel = int(floor(coordinate * float(count)));
    if (wrap == 1) return clamp(texel, 0, count - 1);
    int period = wrap == 2 ? 2 * count : count;
    texel -= period * int(floor(float(texel) / float(period)));
    return wrap == 2 ? min(texel, 2 * count - 1 - texel) : texel;
}

// Whether a masked triangle has a hole at barycentric coordinates; three texels for each in `corners`, two for each mask
// in `masks` (gpu/triangle_tables.py).
bool is_hole(FLOAT_TABLE corners, FLOAT_TABLE masks, sampler2D alphas, int triangle, float u, float v) {
    vec4 a = fetch_row_major(corners, triangle * 3);
    vec4 b = fetch_row_major(corners, triangle * 3 + 1);
    vec4 c = fetch_row_major(corners, triangle * 3 + 2);
    vec3 here = a.xyz * (1.0 - u - v) + b.xyz * u + c.xyz * v;     // texture coordinates, alpha
    vec4 image = fetch_row_major(masks, int(a.w) * 2);              // first row of `alphas`, width, height, cutoff
    vec4 wraps = fetch_row_major(masks, int(a.w) * 2 + 1);
    if (image.y > 0.0) {
        int width = int(image.y);
        int texel = wrapped_texel(here.x, width, int(wraps.x)) + width * wrapped_texel(here.y, int(image.z), int(wraps.y));
        here.z *= texelFetch(alphas, table_place(int(image.x) * TABLE_WIDTH + texel), 0).r;
    }
    return here.z < image.w;
}
#endif

// One over a ray's direction, without infinities.
vec3 inverse_of(vec3 along) { return 1.0 / mix(along, vec3(1e-20), lessThan(abs(along), vec3(1e-20))); }

// Whether a ray passes by a box, or enters it only beyond `most`, a share of its length.
bool misses_box(vec3 low, vec3 high, vec3 from, vec3 inverse, float most) {
    vec3 one = (low - from) * inverse, other = (high - from) * inverse;
    vec3 nearer = min(one, other), farther = max(one, other);
    float enter = max(max(nearer.x, nearer.y), max(nearer.z, 0.0));
    return enter > min(min(farther.x, farther.y), min(farther.z, most));
}

// The first triangle of the next leaf whose box a ray enters, from `node` on, which becomes the one after it; negative: there is
// none. A loop of its own: rays that go together find their leaves, and then meet their triangles, at the same time
// (Aila and Laine 2009, "while-while").
int next_leaf(FLOAT_TABLE nodes, int node_count, vec3 from, vec3 inverse, float most, inout int node) {
    int triangle = -1;
    do {
        vec4 low = fetch_row_major(nodes, node * 2), high = fetch_row_major(nodes, node * 2 + 1);
        bool missed = misses_box(low.xyz, high.xyz, from, inverse, most);
        node = missed ? int(low.w) : node + 1;
        if (!missed) triangle = int(high.w);
    } while (triangle < 0 && node < node_count);
    return triangle;
}

// What a ray meets of a leaf.
struct LeafHit {
    vec3 met;           // as of `meet_triangle`
    int triangle;
    float mask;         // its place among those with holes; negative: it has none
    vec3 normal;        // times twice the area, counter-clockwise front
    bool last;          // of the leaf's triangles
};

// The next triangle of a leaf that a ray meets nearer than `most`, from `triangle` on, or its last one, not met. A loop of its own,
// too: what follows, such as looking for holes, is then not done for each triangle. The number goes up behind the way out: llvmpipe
// makes `hit` anew as long as other rays go on, and so from the same triangle.
LeafHit next_met(FLOAT_TABLE triangles, vec3 from, vec3 along, float most, int triangle) {
    LeafHit hit;
    for (; ; ++triangle) {
        vec4 corner = fetch_row_major(triangles, triangle * 3);
        vec4 edge_u = fetch_row_major(triangles, triangle * 3 + 1), edge_v = fetch_row_major(triangles, triangle * 3 + 2);
        hit = LeafHit(meet_triangle(from, along, corner.xyz, edge_u.xyz, edge_v.xyz), triangle, corner.w,
                      cross(edge_u.xyz, edge_v.xyz), edge_u.w > 0.0);
        if (hit.met.x >= most) hit.met.z = -1.0;
        if (hit.met.z >= 0.0 || hit.last) break;
    }
    return hit;
}

// Whether a triangle lies between two points. Space: that of the triangles.
bool triangles_block(FLOAT_TABLE nodes, FLOAT_TABLE triangles,
#ifdef MASKED
                     FLOAT_TABLE corners, FLOAT_TABLE masks, sampler2D alphas,
#endif
                     int node_count, vec3 from, vec3 to) {
    vec3 along = to - from;
    vec3 inverse = inverse_of(along);
    int node = 0;
    do {
        int triangle = next_leaf(nodes, node_count, from, inverse, 1.0, node);
        if (triangle < 0) break;
        LeafHit hit;
        do {
            hit = next_met(triangles, from, along, 1.0, triangle);
            bool blocks = hit.met.z >= 0.0;
#ifdef MASKED
            blocks = blocks && (hit.mask < 0.0 || !is_hole(corners, masks, alphas, int(hit.mask), hit.met.y, hit.met.z));
#endif
            if (blocks) return true;
            triangle = hit.triangle + 1;
        } while (!hit.last);
    } while (node < node_count);
    return false;
}

// The first triangle that a ray meets: where, as a share of `along`, its number, and its normal times an area. Number -1: none.
struct Met {
    float at;
    int triangle;
    vec3 normal;        // counter-clockwise front
};

Met nearest_triangle(FLOAT_TABLE nodes, FLOAT_TABLE triangles,
#ifdef MASKED
                     FLOAT_TABLE corners, FLOAT_TABLE masks, sampler2D alphas,
#endif
                     int node_count, vec3 from, vec3 along) {
    vec3 inverse = inverse_of(along);
    Met nearest = Met(1.0, -1, vec3(0.0));
    int node = 0;
    do {
        int triangle = next_leaf(nodes, node_count, from, inverse, nearest.at, node);
        if (triangle < 0) break;
        LeafHit hit;
        do {
            hit = next_met(triangles, from, along, nearest.at, triangle);
            bool met = hit.met.z >= 0.0;
#ifdef MASKED
            met = met && (hit.mask < 0.0 || !is_hole(corners, masks, alphas, int(hit.mask), hit.met.y, hit.met.z));
#endif
            if (met) nearest = Met(hit.met.x, hit.triangle, hit.normal);
            triangle = hit.triangle + 1;
        } while (!hit.last);
    } while (node < node_count);
    return nearest;
}
