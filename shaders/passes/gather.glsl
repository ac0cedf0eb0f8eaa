// Monte-Carlo gather of one level: a disc at the starting level, a ring beyond. FORM_FACTOR: 0 disc, 1 point.
// SPACING: 0 even in radius, 1 even in area. VISIBILITY: 0 off, 1 voxel, 2 horizon.
#include "lib/incoming.glsl"
#include "lib/sampling.glsl"
#include "passes/gather_common.glsl"
#include "lib/parts.glsl"

// Walks the sample spiral.
struct Spiral {
    vec2 direction;
    Ring rest;              // from the next sample on
};

// The innermost part of the disc, whose light the upsampling leaves unfiltered: this share of its radius gets this
// share of its samples.
const float NEAR_RADIUS = 1.0 / 6.0;
#if SPACING == 0
const int NEAR_SAMPLES = 4;     // one in four
#else
const int NEAR_SAMPLES = 36;    // one in 36, like its area
#endif

// radiance: times the form factor, so that all sums are over pi until `lobe_of`.
void receive(Receiver receiver, Sender sender, vec3 radiance, inout Incoming light) {
    float weight = receive(dot(receiver.normal, sender.offset) * sender.inverse_distance, radiance, light);
    light.directions += sender.offset * (weight * sender.inverse_distance);
}

Incoming plus(Incoming a, Incoming b) {
    return Incoming(a.irradiance + b.irradiance, a.back_irradiance + b.back_irradiance, a.directions + b.directions,
                    a.weights + b.weights);
}

#if PARTS > 1
Incoming of_all_parts(Incoming light) {
    PartSum sum = sum_of_parts(PartSum(vec4(light.irradiance, light.weights), vec4(light.back_irradiance, 0.0),
                                       vec4(light.directions, 0.0)));
    return Incoming(sum.a.rgb, sum.b.rgb, sum.c.rgb, sum.a.a);
}
#endif

#if VISIBILITY == 2
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

// What stands in the inner part of a ring along a row: the finer levels have gathered its light, and it is looked for
// on the starting level's surfaces. Octave by octave, so that what is near is not missed.
uint blocked_before_ring(Receiver receiver, HalfPlane half_plane, RowRays rays, vec2 direction, float shift) {
    vec2 scale = frame.ray_scale * first_texel;
    vec2 center = (vec2(receiver.px) + 0.5) * (texel / first_texel);
    rays.step *= first_texel / texel;
    uint blocked = 0u;
    float from = 0.0, to = frame.radius;
    int i = 0, step = 0;
    if (blocking_steps > 0) do {
        if (step == octave_steps) {
            step = 0;
            from = to;
            to *= 2.0;
        }
        float radius = mix(from, to, (float(step) + shift) / float(octave_steps));
        vec2 place = center + direction * radius;
        ivec2 at = ivec2(floor(place));
        if (!is_on_screen(at, size_blockers())) break;
        Surface surface = load_blockers(at);
        vec2 in_plane = in_half_plane(half_plane, rays, radius, on_plane(surface, at, place, scale).depth);
        // Worked out for background, too: a CPU would wait for what is seen here before it begins with the next step
        uint hidden = hidden_by(half_plane, elevation(half_plane, in_plane), in_plane, frame.thickness);
        blocked |= surface.view_depth > 0.0 && in_plane.x > 0.0 ? hidden : 0u;
    } while (++step, ++i < blocking_steps);
    return blocked;
}

// Light of the rows of samples that lead away from the receiver in `directions` directions. Walked outwards, each row
// meets everything that may stand before its next sample.
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
        vec3 along = vec3(direction * scale, 0.0);
        HalfPlane half_plane = make_half_plane(receiver.position, receiver.normal, along);
        RowRays rays = rays_of_row(half_plane, along, -receiver.position.z);
        vec2 normal = in_half_plane(half_plane, receiver.normal);
        float shift = fract(jitter + float(d) * 0.618034);
        uint blocked = blocked_before_ring(receiver, half_plane, rays, direction, shift);
        // First what is near, where there is such a part, then the rest: one body for both, since a choice between two sums for
        // every sample took CPUs a tenth longer, and compilers would inline everything twice
        int field = 1 - near_field;
        do {
            bool is_near = field == 0;
            Ring part_ring = is_near ? near_ring : ring;
            int count = is_near ? near_steps : steps - near_steps;
            Incoming sum = NO_LIGHT;
            vec2 directions_in_plane = vec2(0.0);
            int i = 0;
            if (count > 0) do {
                vec2 place = ring_place(part_ring, float(i) + shift);
                vec2 at_place = center + direction * place.x;
                ivec2 at = ivec2(floor(at_place));
                if (!is_on_screen(at, size_surface())) break;
                if (at == receiver.px) continue;
                // All in the half-plane, in which a row lies by construction: two coordinates instead of three
                Surface surface = load_surface(at);
                OnPlane there = on_plane(surface, at, at_place, scale);
                vec2 in_plane = in_half_plane(half_plane, rays, place.x, there.depth);
                float squared = dot(in_plane, in_plane);
                if (surface.view_depth <= 0.0 || squared <= 0.0) continue;
                float inverse_distance = inversesqrt(squared), away = -there.depth * there.slant;
                float front = elevation(half_plane, in_plane);
                // This order lets CPUs do most at once
                vec3 radiance = load_radiance(at);
                Disc disc = disc_of_texel(away + dot(surface.normal, receiver.position), away, 0.01 * there.depth,
                                          surface.view_depth, squared, scale);
                float factor = form_factor(squared, disc, strip * place.y);
                uint hidden = hidden_by(half_plane, front, in_plane, frame.thickness);
                bool is_hidden = sees_blocked(blocked, front, NEARER);
#ifdef VISIBILITY_RAYS
                Sender sender = sender_at(receiver, at, surface, position_from_ray(there.ray, there.depth));
                float weight_to_draw = draw_weight(receiver, sender, radiance, strip * place.y);
                int kind = is_hidden ? HIDDEN : is_near ? SEEN_NEAR : SEEN;
                draw(weight_to_draw, at_place, strip * place.y, random, drawn[kind + KINDS * (i % OF_ROW)]);
#endif
                if (is_hidden) factor = 0.0;
                float weight = receive(dot(normal, in_plane) * inverse_distance, radiance * factor, sum);
                directions_in_plane += in_plane * (weight * inverse_distance);
                blocked |= hidden;
            } while (++i < count);
            sum.directions = half_plane.outward * directions_in_plane.x + half_plane.to_camera * directions_in_plane.y;
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
#else
// Light of the next `count` samples of the spiral.
void gather_samples(Receiver receiver, int count, inout Spiral spiral, inout Incoming light) {
    vec2 center = vec2(receiver.px) + 0.5;
#if PARTS > 1
    // Neighbours in the spiral, so that all threads are about as far out and in the same part of the textures
    vec2 turn = direction_from_angle(GOLDEN_ANGLE * float(PARTS));
    spiral.direction = turned(spiral.direction, GOLDEN_ANGLE * float(part));
    spiral.rest.from += spiral.rest.step * float(part);
#endif
#if VISIBILITY == 1
    vec2 scale = frame.ray_scale * texel;
    Slicing slicing = make_slicing(load_depth_range(ivec2(0)));
    VoxelEnd here = voxel_end(slicing, receiver.px, receiver.position, receiver.normal, scale);
#endif
    int i = part;
    if (i < count) do {
        vec2 place = ring_place(spiral.rest, 0.0);
        float texels = 2.0 * PI * place.y;      // that this sample stands for
        ivec2 at = ivec2(floor(center + spiral.direction * place.x));
#if PARTS > 1
        spiral.direction = rotated(spiral.direction, turn);
#else
        spiral.direction = golden_rotation(spiral.direction);
#endif
        spiral.rest.from += spiral.rest.step * float(PARTS);
        bool seen = may_see(receiver, at);
#ifndef ZERO_OUTSIDE
        if (!seen) continue;
#endif
        Sender sender = look_at(receiver, at);
        Disc disc = texel_disc(sender);
        seen = seen && disc.above > 0.0;
#ifndef ZERO_OUTSIDE
        // Such loads are for CPUs, which work through the rest in any case
        if (!seen) continue;
#endif
        vec3 radiance = load_radiance(at) * (seen ? form_factor(sender, disc, texels) : 0.0);
#if VISIBILITY == 1
        if (radiance == vec3(0.0)) continue;
        VoxelEnd there = voxel_end(slicing, at, sender.position, sender.normal, scale);
        if (voxels_block(texture_voxels, texture_voxels_far, slicing, here, there)) continue;
#endif
        receive(receiver, sender, radiance, light);
    } while ((i += PARTS) < count);
}
#endif

#ifdef HAS_UNSEEN
void receive_unseen(Lobe lobe, vec3 normal, inout Incoming light) {
    light.irradiance += lobe.flux * (lobe_response(lobe.direction, normal) * (1.0 / PI));
    light.back_irradiance += lobe.flux * (lobe.back * (1.0 / PI));
    float weight = lobe_weight(lobe.flux) * (1.0 / PI);
    light.directions += lobe.direction * weight;
    light.weights += weight;
}
#endif

Lobe lobe_of(Incoming light, vec3 normal) {
    return make_lobe(light.irradiance * PI, light.back_irradiance * PI, light.directions, light.weights, normal);
}

// What this thread finds for a receiver.
void gather(Receiver receiver, out Incoming near, out Incoming light) {
    near = NO_LIGHT;
    light = NO_LIGHT;
    vec2 jitter = fract(interleaved_4x4(receiver.px) + frame.jitter);
#if VISIBILITY == 2
    // Within the angle from one row to the next: a turn by whole rows would be none
    gather_rows(receiver, direction_from_turn(jitter.x / float(directions)), jitter.y, near, light);
#else
    vec2 direction = direction_from_turn(jitter.x);
    // A single sample is a near one; the rest of the disc then goes without.
    int near_samples = near_field * ((frame.samples + NEAR_SAMPLES - 1) / NEAR_SAMPLES);
    float inner = near_field == 1 ? frame.radius * NEAR_RADIUS : inner_radius;
    // First what is near, where there is such a part, then the rest: one call, since compilers inline each one.
    int field = 1 - near_field;
    do {
        bool rest = field == 1;
        int count = rest ? frame.samples - near_samples : near_samples;
        Ring ring = make_ring(rest ? inner : 0.0, rest ? frame.radius : inner, count);
        ring.from += jitter.y * ring.step;
        Spiral spiral = Spiral(direction, ring);
        Incoming sum = NO_LIGHT;
        gather_samples(receiver, count, spiral, sum);
#if PARTS > 1
        direction = turned(direction, GOLDEN_ANGLE * float(count));
#else
        direction = spiral.direction;
#endif
        if (rest) light = sum;
        else near = sum;
    } while (++field < 2);
#endif
}

void shade(ivec2 px) {
    Lobe dark = Lobe(vec3(0.0), vec3(0.0), 0.0);
    out_gather = dark;
    out_near = dark;
    Surface surface = load_surface(px);
    Incoming near = NO_LIGHT, light = NO_LIGHT;
    if (surface.view_depth > 0.0) {
        vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
        gather(Receiver(px, position_from_ray(ray, surface.view_depth), surface.normal), near, light);
    }
#if PARTS > 1
    if (near_field == 1) near = of_all_parts(near);
    light = of_all_parts(light);
#endif
    if (surface.view_depth <= 0.0) return;
#ifdef HAS_UNSEEN
    receive_unseen(load_unseen(px), surface.normal, light);
#endif
    out_near = lobe_of(near, surface.normal);
    out_gather = lobe_of(light, surface.normal);
}
