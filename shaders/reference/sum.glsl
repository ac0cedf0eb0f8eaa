// References R1 and, with RAYS, R2: some more senders' light at each pixel, added to what is there.
//
// The texels of the senders' level form `1 << 2 * bits` slices, each an even grid over the whole image. A pixel goes
// through all of them in an order of its own and so sees every sender exactly once in a sweep; before its end, what it
// has seen is a fair sample. With RAYS one sender of each slice, drawn in proportion to its light, stands for the slice:
// whether it is hidden decides for all of it, which is right in the mean.
// Where even one slice of all pixels takes long, a run deals with one of `1 << 2 * part_bits` parts of the 8x8 tiles of the
// image. The sums' alpha counts the slices.
// TRIANGLE_NORMALS: senders are the image's own pixels, and have the normals of their triangles.
//   one: 1 (lib/compensated.glsl).
//   first: pixel where the image begins in what was rendered; first_sender: the same in texels of the senders' level.
#define VISIBILITY 0
#define SPACING 0
#include "passes/gather_common.glsl"
#include "lib/compensated.glsl"
#include "lib/hash.glsl"
#ifdef RAYS
#include "lib/triangle_tree.glsl"
#endif

// Place number `index` of a square with 1 << bits places along each side. Neighbours in the order lie far apart: bits are
// dealt out from the coarse end.
ivec2 dealt_out(int index, int bits) {
    ivec2 place = ivec2(0);
    for (int bit = 0; bit < bits; ++bit)
        place += ivec2((index >> (2 * bit)) & 1, (index >> (2 * bit + 1)) & 1) << (bits - 1 - bit);
    return place;
}

const float SAME_NORMAL = 0.9998;   // as in reference/all_pixels.py

struct Slice {
    vec3 light;
#ifdef RAYS
    vec3 carried;       // by the drawn sender: its colour times the light of all, as the mean of the channels
    ivec2 drawn;
#endif
};

Slice add_up(Receiver receiver, ivec2 corner, uint random) {
    Slice slice;
    slice.light = vec3(0.0);
#ifdef RAYS
    float total = 0.0;
    slice.carried = vec3(0.0);
    slice.drawn = ivec2(-1);
#endif
    int stride = 1 << bits;
    for (int y = corner.y; y < senders.y; y += stride)
        for (int x = corner.x; x < senders.x; x += stride) {
            ivec2 at = first_sender + ivec2(x, y);
            if (!may_see(receiver, at)) continue;
            Sender sender = look_at(receiver, at);
            if (!is_seen(sender)) continue;
#ifdef TRIANGLE_NORMALS
            // Kept to a degree: a grazing sender's area would be wrong by per cents. Where they agree, the surface's own is exact
            vec3 of_triangle = decode_direction16(load_motion(at).w);
            if (dot(of_triangle, sender.normal) < SAME_NORMAL) sender.normal = of_triangle;
#endif
            float cosine = max(dot(receiver.normal, sender.offset), 0.0) * sender.inverse_distance;
            float factor = PI * cosine * form_factor(sender, 1.0);
            if (factor <= 0.0) continue;
            vec3 light = load_radiance(at) * factor;
            slice.light += light;
#ifdef RAYS
            float weight = dot(light, vec3(1.0 / 3.0));
            total += weight;
            random = hash(random);
            if (weight > 0.0 && unit_float(random) * total < weight) {
                slice.drawn = ivec2(x, y);
                slice.carried = light / weight;
            }
#endif
        }
#ifdef RAYS
    slice.carried *= total;
#endif
    return slice;
}

#ifdef RAYS
// Whether something lies between two points that the camera sees, both lifted off their surfaces by LIFT.
bool hidden_from(vec3 from, vec3 to) {
    vec3 a = (frame.world_from_view * vec4(from * (1.0 - LIFT), 1.0)).xyz;
    vec3 b = (frame.world_from_view * vec4(to * (1.0 - LIFT), 1.0)).xyz;
    return triangles_block(texture_nodes, texture_triangles,
#ifdef MASKED
                           texture_corners, texture_masks, texture_alphas,
#endif
                           node_count, a, b);
}
#endif

void shade(ivec2 px) {
    vec4 before = fresh == 1 ? vec4(0.0) : load_sum_before(px);
    vec3 sum = before.rgb;
    vec3 lost = fresh == 1 ? vec3(0.0) : load_lost_before(px).rgb;
#ifdef RAYS
    vec3 hidden = fresh == 1 ? vec3(0.0) : load_hidden_before(px).rgb;
    vec3 hidden_lost = fresh == 1 ? vec3(0.0) : load_hidden_lost_before(px).rgb;
#endif
    Surface surface = load_receivers(px + first);
    bool in_turn = ((px >> 3) & ((1 << part_bits) - 1)) == dealt_out(part, part_bits);
    if (surface.view_depth > 0.0 && in_turn) {
        vec2 ray = ray_from_pixel(vec2(px + first) + 0.5, frame.ray_scale, frame.ray_origin);
        Receiver receiver = Receiver(ivec2(-1), position_from_ray(ray, surface.view_depth), normalize(surface.normal));
        int mask = (1 << (2 * bits)) - 1;
        uint place = hash(uint(px.x) ^ hash(uint(px.y)));
        for (int slice = first_slice; slice < first_slice + slices; ++slice) {
            uint sweep = uint(slice >> (2 * bits));
            int own = (slice ^ int(hash(place ^ sweep))) & mask;
            Slice found = add_up(receiver, dealt_out(own, bits), hash(place + uint(slice) * 0x9E3779B9u));
            add_compensated(sum, lost, found.light, one);
#ifdef RAYS
            if (found.drawn.x >= 0 && hidden_from(receiver.position, load_ends(found.drawn).xyz))
                add_compensated(hidden, hidden_lost, found.carried, one);
#endif
        }
    }
    out_sum = vec4(sum, before.a + (in_turn ? float(slices) : 0.0));
    out_lost = vec4(lost, 0.0);
#ifdef RAYS
    out_hidden = vec4(hidden, 0.0);
    out_hidden_lost = vec4(hidden_lost, 0.0);
#endif
}
