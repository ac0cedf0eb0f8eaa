// Reflected radiance of one level, for a reflectance of 1: a disc at the starting level, a ring beyond.
// IMPORTANCE: 1 samples lie in the wedge of the image that the lobe fills, 0 all around.
// FORM_FACTOR, SPACING, VISIBILITY: see gather_common.glsl.
#include "lib/sampling.glsl"
#include "passes/gather_common.glsl"
#include "passes/glossy_receiver.glsl"

const float TURN = 2.0 * PI;
const float GOLDEN_TURN = 0.6180339887498949;

// Part of the image in which samples lie, seen from the receiver.
struct Wedge {
    float middle;       // angle in the image
    float width;        // radians; 2 pi for the whole disc
};

// Direction in the image of a displacement of the receiver, in texels.
vec2 image_direction(vec3 position, vec3 displacement) {
    vec2 scale = frame.ray_scale * texel;
    return (displacement.xy + position.xy / -position.z * displacement.z) / scale;
}

// A cone around the mirror direction lies, seen along the view ray, between two half-planes through that ray, which
// are lines of the image.
Wedge wedge_of(Receiver receiver, Mirror mirror) {
#if IMPORTANCE == 1
    vec3 view = normalize(receiver.position);
    float cone_cos = lobe_cone_cos(mirror.exponent);
    float cone_sin = sqrt(max(1.0 - cone_cos * cone_cos, 0.0));
    vec3 across = mirror.direction - view * dot(view, mirror.direction);
    float ray_sin = length(across);
    if (cone_sin < ray_sin * 0.999) {
        across /= ray_sin;
        float s = cone_sin / ray_sin;
        vec3 along = across * sqrt(1.0 - s * s), aside = cross(across, view) * s;
        vec2 from = image_direction(receiver.position, along - aside);
        vec2 to = image_direction(receiver.position, along + aside);
        float width = atan(from.x * to.y - from.y * to.x, dot(from, to));
        return Wedge(atan(from.y, from.x) + 0.5 * width, abs(width));
    }
#endif
    return Wedge(0.0, TURN);
}

// A texel is taken as a whole, as wide as it is: the wedge is so much wider on each side, in texels, for the texels that
// lie half in it and for the lobes that widen to a texel's size.
const float WEDGE_MARGIN = 1.5;

// Half of the width that is added. The whole disc needs none.
float margin_of(Wedge wedge) { return wedge.width < TURN ? WEDGE_MARGIN : 0.0; }

// A line of samples, one of those that go from edge to edge of the wedge: along a ray of it, but moved aside, since the
// margin is as wide everywhere.
struct Row {
    vec2 direction;
    vec2 aside;             // texels
};

// across: 0 at one edge, 1 at the other.
Row row_of(Wedge wedge, float across, float margin) {
    vec2 direction = direction_from_angle(wedge.middle + (across - 0.5) * wedge.width);
    return Row(direction, vec2(-direction.y, direction.x) * ((2.0 * across - 1.0) * margin));
}

// From the receiver to a sample, in texels.
vec2 place_in(Row row, float radius) { return row.direction * radius + row.aside; }

// Texels that a sample stands for: rays part by the wedge's angle times the radius, plus both margins.
float texels_of(Wedge wedge, Ring ring, vec2 place, float margin) {
#if SPACING == 0
    return (wedge.width * place.x + 2.0 * margin) * ring.step;
#else
    return (wedge.width + 2.0 * margin / max(place.x, 1e-3)) * place.y;
#endif
}

// Levels take turns gradually: a narrow lobe ends within a few texels, and pixels between two coarse receivers would
// see it in both levels' rings or in none. Weight of a sample at this radius; over all levels they add up to 1.
float ring_weight(float radius) {
    float rising = clamp((radius - inner_radius) * fade.x, 0.0, 1.0);
    float falling = clamp((frame.radius - radius) * fade.y, 0.0, 1.0);
    return (fade.x > 0.0 ? rising : 1.0) * (fade.y > 0.0 ? falling : 1.0);
}

// Share of a sender's radiance that reaches the camera over the receiver; `texels`: texels that it stands for.
float reflectance(Receiver receiver, Mirror mirror, Sender sender, float texels) {
    float lobe_cos = dot(mirror.direction, sender.offset) * sender.inverse_distance;
    float receiver_cos = dot(receiver.normal, sender.offset) * sender.inverse_distance;
#ifndef ZERO_OUTSIDE
    if (lobe_cos <= 0.0 || receiver_cos <= 0.0) return 0.0;     // a CPU works through the rest in any case
#endif
    Disc disc = texel_disc(sender);
    // The lobe's mean over the texel: a narrow one would fall between coarse texels, and burst where surfaces meet
    float narrowing = narrowing_by_disc(mirror.exponent, disc.above, disc.below * sender.distance_squared);
    // The cosine where texel and lobe overlap: the mean of the product of two Gaussians. With the texel's own, surfaces
    // that are seen at a grazing angle reflected up to half too much.
    float overlap_cos = mix(mirror.n_dot_r, receiver_cos, narrowing);
    float share = phong_lobe(mirror.exponent * narrowing, clamp(lobe_cos, 1e-6, 1.0)) * mirror.scale * PI * overlap_cos
                * form_factor(sender, disc, texels);
    return lobe_cos > 0.0 && receiver_cos > 0.0 ? share : 0.0;
}

#if VISIBILITY == 2
// Rows of samples that lead away from the receiver; see gather_rows.glsl.
vec3 gather_rows(Receiver receiver, Mirror mirror, Wedge wedge, vec2 jitter) {
    HalfPlane half_plane = half_planes_of(receiver.position);
    float normal_facing = dot(receiver.normal, half_plane.to_camera), margin = margin_of(wedge);
    int inner_steps = inner_radius > 0.0 ? (steps + 1) / 2 : 0;
    Ring inside = make_ring(0.0, inner_radius, inner_steps), ring = make_ring(inner_radius, frame.radius, steps);
    vec3 sum = vec3(0.0);
    int d = 0;
    do {
        Row row = row_of(wedge, (float(d) + jitter.x) / float(directions), margin);
        float shift = fract(jitter.y + float(d) * GOLDEN_TURN);
        uint blocked = 0u;
        int i = 0;
        do {
            bool is_inner = i < inner_steps;
            vec2 place = is_inner ? ring_place(inside, float(i) + shift) : ring_place(ring, float(i - inner_steps) + shift);
            vec2 apart = place_in(row, place.x);
            ivec2 at = ivec2(floor(vec2(receiver.px) + 0.5 + apart));
            bool seen = may_see(receiver, at);
#ifndef ZERO_OUTSIDE
            if (!seen) continue;
#endif
            Sender sender = look_at(receiver, at);
            seen = seen && is_seen(sender);
#ifdef ZERO_OUTSIDE
            // For CPUs, which work through the rest in any case: a long wait, which so does not begin with the last step
            vec3 radiance = load_radiance(at);
#else
            if (!seen) continue;
#endif
            // The margin moves rows aside: each sample has its own half-plane, or the receiver's own surface would seem
            // to rise above itself
            float height = dot(receiver.normal, sender.offset);
            vec2 in_plane = turn_to(half_plane, sender.offset, sender.distance_squared, height, normal_facing);
            float front = elevation(half_plane, in_plane);
            if (seen && !is_inner && !sees_blocked(blocked, front, 0.5)) {
                float texels = texels_of(wedge, ring, place, margin) / float(directions);
                float share = reflectance(receiver, mirror, sender, texels) * ring_weight(length(apart));
#ifdef ZERO_OUTSIDE
                sum += radiance * (share > 0.0 ? share : 0.0);
#else
                if (share > 0.0) sum += load_radiance(at) * share;
#endif
            }
            uint hidden = hidden_by(half_plane, front, in_plane, frame.thickness);
            blocked |= seen ? hidden : 0u;
        } while (++i < inner_steps + steps);
    } while (++d < directions);
    return sum;
}
#else
vec3 gather_samples(Receiver receiver, Mirror mirror, Wedge wedge, vec2 jitter) {
#if VISIBILITY == 1
    vec2 scale = frame.ray_scale * texel;
    Slicing slicing = make_slicing(load_depth_range(ivec2(0)));
    VoxelEnd here = voxel_end(slicing, receiver.px, receiver.position, receiver.normal, scale);
#endif
    Ring ring = make_ring(inner_radius, frame.radius, samples);
    float margin = margin_of(wedge);
    vec3 sum = vec3(0.0);
    int i = 0;
    do {
        vec2 place = ring_place(ring, float(i) + jitter.y);
        // The golden ratio's multiples are as even across a wedge as the golden angle's around a disc
        vec2 apart = place_in(row_of(wedge, fract(jitter.x + float(i) * GOLDEN_TURN), margin), place.x);
        ivec2 at = ivec2(floor(vec2(receiver.px) + 0.5 + apart));
        if (!may_see(receiver, at)) continue;
        Sender sender = look_at(receiver, at);
        if (!is_seen(sender)) continue;
        float texels = texels_of(wedge, ring, place, margin);
        float share = reflectance(receiver, mirror, sender, texels) * ring_weight(length(apart));
        if (share <= 0.0) continue;
        vec3 radiance = load_radiance(sender.px) * share;
#if VISIBILITY == 1
        if (radiance == vec3(0.0)) continue;
        VoxelEnd there = voxel_end(slicing, sender.px, sender.position, sender.normal, scale);
        if (voxels_block(texture_voxels, texture_voxels_far, slicing, here, there)) continue;
#endif
        sum += radiance;
    } while (++i < samples);
    return sum;
}
#endif

void shade(ivec2 px) {
    out_glossy_gather = Reflection(vec3(0.0), -1.0, 0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    Receiver receiver = Receiver(px, position_from_ray(ray, surface.view_depth), normalize(surface.normal));
    Kept kept = what_is_kept(px, surface, receiver.position);
    float roughness = kept.roughness;
    if (roughness < 0.0) return;
    receiver.position = kept_position(px, surface, receiver.position, kept);
    Mirror mirror = mirror_of(roughness, receiver.position, receiver.normal);
    Wedge wedge = wedge_of(receiver, mirror);
    vec2 jitter = fract(interleaved_4x4(px) + frame.jitter);
#if VISIBILITY == 2
    vec3 radiance = gather_rows(receiver, mirror, wedge, jitter);
#else
    vec3 radiance = gather_samples(receiver, mirror, wedge, jitter);
#endif
#ifdef HAS_UNSEEN
    radiance += load_unseen(px);
#endif
    out_glossy_gather = Reflection(radiance, roughness, 0.0);
}
