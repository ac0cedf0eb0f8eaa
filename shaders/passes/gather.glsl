// Monte-Carlo gather of one level: a disc at the starting level, a ring beyond. FORM_FACTOR: 0 disc, 1 point.
// SPACING: 0 even in radius, 1 even in area. VISIBILITY: 0 off, 1 voxel, 2 horizon.
#include "lib/incoming.glsl"
#include "lib/sampling.glsl"
#include "passes/gather_common.glsl"
#include "lib/parts.glsl"

// A CPU spends most of a sample waiting for its own intermediate results. Two samples that take turns, of two rows or of the spiral,
// fill the gaps: the gather takes a tenth less. Not where rays or voxels follow, which take far longer than the sample.
#if defined(ZERO_OUTSIDE) && !defined(VISIBILITY_RAYS) && VISIBILITY != 1
#define PAIRS
#endif

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
#include "passes/gather_rows.glsl"
#else
// A sample of the spiral. radiance: times the form factor, black for background and what faces away.
struct Sample {
    Sender sender;
    vec3 radiance;
};

// The spiral's next one. turn: from it to the one after that.
Sample next_sample(Receiver receiver, vec2 turn, inout Spiral spiral) {
    vec2 place = ring_place(spiral.rest, 0.0);
    float texels = 2.0 * PI * place.y;      // that this sample stands for
    ivec2 at = ivec2(floor(vec2(receiver.px) + 0.5 + spiral.direction * place.x));
    spiral.direction = rotated(spiral.direction, turn);
    spiral.rest.from += spiral.rest.step * float(PARTS);
    bool seen = may_see(receiver, at);
    Sample found;
    found.radiance = vec3(0.0);
#ifndef ZERO_OUTSIDE
    if (!seen) return found;
#endif
    found.sender = look_at(receiver, at);
    Disc disc = texel_disc(found.sender);
    seen = seen && disc.above > 0.0;
#ifndef ZERO_OUTSIDE
    // Such loads are for CPUs, which work through the rest in any case
    if (!seen) return found;
#endif
    found.radiance = load_radiance(at) * (seen ? form_factor(found.sender, disc, texels) : 0.0);
    return found;
}

// Light of the next `count` samples.
void gather_samples(Receiver receiver, int count, Spiral spiral, inout Incoming light) {
#if PARTS > 1
    // Neighbours in the spiral, so that all threads are about as far out and in the same part of the textures
    vec2 turn = direction_from_angle(GOLDEN_ANGLE * float(PARTS));
    spiral.direction = turned(spiral.direction, GOLDEN_ANGLE * float(part));
    spiral.rest.from += spiral.rest.step * float(part);
#else
    vec2 turn = vec2(GOLDEN_ANGLE_COS, GOLDEN_ANGLE_SIN);
#endif
#if VISIBILITY == 1
    vec2 scale = frame.ray_scale * texel;
    Slicing slicing = make_slicing(load_depth_range(ivec2(0)));
    VoxelEnd here = voxel_end(slicing, receiver.px, receiver.position, receiver.normal, scale);
#endif
    int i = part;
    if (i < count) do {
        Sample found = next_sample(receiver, turn, spiral);
#ifdef PAIRS
        Sample other = next_sample(receiver, turn, spiral);
        if (++i == count) other.radiance = vec3(0.0);       // there is none
        receive(receiver, other.sender, other.radiance, light);
#else
        if (found.radiance == vec3(0.0)) continue;
#endif
#if VISIBILITY == 1
        VoxelEnd there = voxel_end(slicing, found.sender.px, found.sender.position, found.sender.normal, scale);
        if (voxels_block(texture_voxels, texture_voxels_far, slicing, here, there)) continue;
#endif
        receive(receiver, found.sender, found.radiance, light);
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
        direction = turned(direction, GOLDEN_ANGLE * float(count));
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
