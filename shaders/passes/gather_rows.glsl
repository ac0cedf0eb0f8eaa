// The gather with `--visibility horizon`: samples lie in rows that lead straight away from the receiver. Walked outwards, each row
// meets everything that may stand before its next sample. Included by gather.glsl.

#ifdef VISIBILITY_RAYS
// No light is negative: where one sample stands for others that differ, sums may be.
Incoming positive(Incoming light) {
    return Incoming(max(light.irradiance, 0.0), max(light.back_irradiance, 0.0), light.directions, max(light.weights, 0.0));
}

// The directions of such sums are again a mean of unit vectors before the surface. Others would make lobes that shine a
// hundred times too bright on some pixel.
Incoming bounded(Incoming light, vec3 normal) {
    light.directions -= normal * min(dot(light.directions, normal), 0.0);
    light.directions *= min(1.0, light.weights * inversesqrt(max(dot(light.directions, light.directions), 1e-30)));
    return light;
}

#include "passes/gather_rays.glsl"
#endif

// Bits; less than the half that is sure to do, since senders follow their planes and lie where the row does.
const float NEARER = 0.35;

struct Row {
    vec2 direction;         // in the image
    HalfPlane half_plane;
    RowRays rays;
    vec2 normal;            // the receiver's, in the half-plane
    float shift;            // of its samples, from 0 to 1 of a step
    uint blocked;           // elevations, by what was met so far
    vec2 directions;        // sum of the light's directions, in the half-plane
};

Row make_row(Receiver receiver, vec2 direction, float shift, vec2 scale) {
    vec3 along = vec3(direction * scale, 0.0);
    HalfPlane half_plane = make_half_plane(receiver.position, receiver.normal, along);
    return Row(direction, half_plane, rays_of_row(half_plane, along, -receiver.position.z),
               in_half_plane(half_plane, receiver.normal), shift, 0u, vec2(0.0));
}

// Blocks what is hidden by the starting level's surface at so many of its texels from the receiver.
void meet_blocker(float radius, inout Row row, vec2 center, vec2 scale) {
    vec2 place = center + row.direction * radius;
    ivec2 at = ivec2(floor(place));
#ifndef ZERO_OUTSIDE
    if (!is_on_screen(at, size_blockers())) return;
#endif
    Surface surface = load_blockers(at);
    vec2 in_plane = in_half_plane(row.half_plane, row.rays, radius * (first_texel / texel), on_plane(surface, at, place, scale).depth);
    // Worked out for background, too: a CPU would wait for what is seen here before it begins with the next step
    uint hidden = hidden_by(row.half_plane, elevation(row.half_plane, in_plane), in_plane, frame.thickness);
    row.blocked |= surface.view_depth > 0.0 && in_plane.x > 0.0 ? hidden : 0u;
}

// Walks two rows through the inner part of a ring: the finer levels have gathered its light, and what stands there is looked
// for on the starting level's surfaces. Octave by octave, so that what is near is not missed. A coarse texel may hang
// over the image's edge, so that a row may begin outside. other: without PAIRS left as it is.
void walk_to_ring(Receiver receiver, inout Row row, inout Row other) {
    vec2 scale = frame.ray_scale * first_texel, center = (vec2(receiver.px) + 0.5) * (texel / first_texel);
    float from = 0.0, to = frame.radius;
    int i = 0, step = 0;
    if (blocking_steps > 0) do {
        if (step == octave_steps) {
            step = 0;
            from = to;
            to *= 2.0;
        }
        meet_blocker(mix(from, to, (float(step) + row.shift) / float(octave_steps)), row, center, scale);
#ifdef PAIRS
        meet_blocker(mix(from, to, (float(step) + other.shift) / float(octave_steps)), other, center, scale);
#endif
    } while (++step, ++i < blocking_steps);
}

// What is seen at a place of a row, all in the half-plane, in which it lies by construction: two coordinates instead of three.
struct Step {
    vec2 place;             // of its ring; see ring_place
    vec2 at_place;          // in texels
    ivec2 at;
    Surface surface;
    OnPlane there;
    vec2 in_plane;
    bool inside;            // of the image
};

Step step_of(Row row, vec2 center, vec2 place, vec2 scale) {
    vec2 at_place = center + row.direction * place.x;
    ivec2 at = ivec2(floor(at_place));
    Surface surface = Surface(0.0, vec3(0.0), 0.0);
    bool inside = is_on_screen(at, size_surface());
#ifndef ZERO_OUTSIDE
    if (inside)
#endif
        surface = load_surface(at);
    OnPlane there = on_plane(surface, at, at_place, scale);
    return Step(place, at_place, at, surface, there, in_half_plane(row.half_plane, row.rays, place.x, there.depth), inside);
}

// A sample as it counts unless it is hidden: background and the receiver itself are not seen.
struct Sample {
    bool seen;
    vec3 radiance;
    float factor, inverse_distance;
    float front;            // its elevation
    uint hidden;            // what it hides
};

const Sample NOTHING = Sample(false, vec3(0.0), 0.0, 0.0, 0.0, 0u);

// strip: texels between two rows, per texel of radius.
Sample weigh(Receiver receiver, Step step, float strip, vec2 scale, Row row) {
    Surface surface = step.surface;
    float squared = dot(step.in_plane, step.in_plane);
    bool seen = step.at != receiver.px && surface.view_depth > 0.0 && squared > 0.0;
#ifndef PAIRS
    if (!seen) return NOTHING;
#endif
    // This order lets CPUs do most at once
    vec3 radiance = load_radiance(step.at);
    squared = max(squared, 1e-30);
    float inverse_distance = inversesqrt(squared), away = -step.there.depth * step.there.slant;
    float front = elevation(row.half_plane, step.in_plane);
    Disc disc = disc_of_texel(away + dot(surface.normal, receiver.position), away, 0.01 * step.there.depth,
                              surface.view_depth, squared, scale);
    float factor = form_factor(squared, disc, strip * step.place.y);
    uint hidden = hidden_by(row.half_plane, front, step.in_plane, frame.thickness);
    return Sample(seen, radiance, seen ? factor : 0.0, inverse_distance, front, seen ? hidden : 0u);
}

// Adds the light of a sample; false if what was met before hides it.
bool take(Step step, Sample weighed, inout Row row, inout Incoming sum) {
    bool is_hidden = sees_blocked(row.blocked, weighed.front, NEARER);
    vec3 light = weighed.radiance * (is_hidden ? 0.0 : weighed.factor);
    float weight = receive(dot(row.normal, step.in_plane) * weighed.inverse_distance, light, sum);
    row.directions += step.in_plane * (weight * weighed.inverse_distance);
    row.blocked |= weighed.hidden;
    return !is_hidden;
}

vec3 mean_direction(Row row) {
    return row.half_plane.outward * row.directions.x + row.half_plane.to_camera * row.directions.y;
}

void gather_rows(Receiver receiver, vec2 direction, float jitter, inout Incoming near, inout Incoming light) {
    vec2 center = vec2(receiver.px) + 0.5, scale = frame.ray_scale * texel;
    int near_steps = near_field * ((steps + NEAR_SAMPLES - 1) / NEAR_SAMPLES);
#ifdef VISIBILITY_RAYS
    float near_end = near_radius;
#else
    float near_end = frame.radius * NEAR_RADIUS;
#endif
    float inner = near_field == 1 ? near_end : inner_radius;
    Ring near_ring = make_ring(0.0, inner, near_steps), ring = make_ring(inner, frame.radius, steps - near_steps);
    float strip = 2.0 * PI / float(directions);
    vec2 turn = direction_from_angle(strip * float(PARTS));
#if PARTS > 1
    direction = turned(direction, strip * float(part));
#endif
#ifdef VISIBILITY_RAYS
    uint random = hash(uint(receiver.px.x + (receiver.px.y << 14)) ^ hash(uint(random_seed) * 2654435761u + uint(texel)));
    Incoming missing_near = NO_LIGHT, missing = NO_LIGHT;
    Draw drawn[DRAWS];
    for (int r = 0; r < DRAWS; ++r) drawn[r] = NOTHING_DRAWN;
#endif
    int d = part;
    if (d < directions) do {
        Row row = make_row(receiver, direction, fract(jitter + float(d) * 0.618034), scale), other = row;
        int stride = 1;         // steps of a row from one turn to the next
#ifdef PAIRS
        // Nothing is skipped: steps on background or outside, where loads are 0, count for nothing and hide nothing.
        // The last row of an odd number is a pair with itself: `other` is one step ahead, and what is blocked goes to and fro
        if (d + 1 == directions) {
            stride = 2;
        } else {
            ++d;
            direction = rotated(direction, turn);
            other = make_row(receiver, direction, fract(jitter + float(d) * 0.618034), scale);
        }
#endif
        walk_to_ring(receiver, row, other);
        // First what is near, where there is such a part, then the rest: one body for both, since a choice between two sums for
        // every sample took CPUs a tenth longer, and compilers would inline everything twice
        int field = 1 - near_field;
        do {
            bool is_near = field == 0;
            Ring part_ring = is_near ? near_ring : ring;
            int count = is_near ? near_steps : steps - near_steps;
            Incoming sum = NO_LIGHT;
            row.directions = vec2(0.0);
            other.directions = vec2(0.0);
            int i = 0;
            if (count > 0) do {
                Step step = step_of(row, center, ring_place(part_ring, float(i) + row.shift), scale);
#ifdef PAIRS
                int next = i + stride - 1;      // the other's step: the same, or the next one of one row
                Step other_step = step_of(other, center, ring_place(part_ring, float(next) + other.shift), scale);
                if (!step.inside && !other_step.inside) break;      // a row that has left never comes back
                Sample weighed = weigh(receiver, step, strip, scale, row);
                Sample other_weighed = weigh(receiver, other_step, strip, scale, other);
                if (next >= count) {    // there is none
                    other_weighed.factor = 0.0;
                    other_weighed.hidden = 0u;
                }
                take(step, weighed, row, sum);
                if (stride == 2) other.blocked = row.blocked;
                take(other_step, other_weighed, other, sum);
                if (stride == 2) row.blocked = other.blocked;
#else
                if (!step.inside) break;
                Sample weighed = weigh(receiver, step, strip, scale, row);
                if (!weighed.seen) continue;
                bool shines = take(step, weighed, row, sum);
#ifdef VISIBILITY_RAYS
                Sender sender = sender_at(receiver, step.at, step.surface, position_from_ray(step.there.ray, step.there.depth));
                float texels = strip * step.place.y;
                int kind = shines ? is_near ? SEEN_NEAR : SEEN : HIDDEN;
                draw(draw_weight(receiver, sender, weighed.radiance, texels), step.at_place, texels, random,
                     drawn[kind + KINDS * (i % OF_ROW)]);
#endif
#endif
            } while ((i += stride) < count);
            sum.directions = mean_direction(row);
#ifdef PAIRS
            sum.directions += mean_direction(other);
#endif
            if (is_near) near = plus(near, sum);
            else light = plus(light, sum);
        } while (++field < 2);
#ifdef VISIBILITY_RAYS
        if (((d + 1) * ray_groups) / directions != (d * ray_groups) / directions)
            for (int r = 0; r < DRAWS; ++r) {
                int kind = r % KINDS;
                // What is near is not denoised, seen or hidden by horizons: a ledge lights what is above it, not what is below
                bool is_near = kind == SEEN_NEAR
                            || kind == HIDDEN && near_field == 1 && distance(drawn[r].place, center) < near_end;
                Incoming found = missing_light(receiver, drawn[r], kind != HIDDEN, is_near ? MOST_NEAR : MOST, random, missing);
                if (is_near) missing_near = plus(missing_near, found);
                else missing = plus(missing, found);
                drawn[r] = NOTHING_DRAWN;
            }
#endif
        direction = rotated(direction, turn);
    } while ((d += PARTS) < directions);
#ifdef VISIBILITY_RAYS
    near = plus(near, missing_near);
    light = plus(light, missing);
    near = bounded(positive(near), receiver.normal);
    light = bounded(positive(light), receiver.normal);
#endif
}
