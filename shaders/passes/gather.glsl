// Monte-Carlo gather of one level: a disc at the starting level, a ring beyond. FORM_FACTOR: 0 disc, 1 point.
// SPACING: 0 even in radius, 1 even in area. VISIBILITY: 0 off, 1 voxel.
#include "lib/lobe.glsl"
#include "lib/sampling.glsl"
#if VISIBILITY == 1
#include "lib/voxels.glsl"
#ifndef HAS_VOXELS_FAR
#define texture_voxels_far texture_voxels
#endif
#endif

const float PI = 3.141592653589793;

struct Receiver {
    ivec2 px;
    vec3 position;
    vec3 normal;
};

struct Incoming {
    vec3 irradiance;        // over pi
    vec3 back_irradiance;   // on the other side, over pi
    vec3 directions;        // sum of unit directions times weight
    float weights;
};

// Walks the sample spiral. Spaced evenly in radius, near senders, whose light varies fastest, get most of the samples,
// and each stands for the area of its own strip of the spiral; spaced evenly in area, as in the talk, all stand for
// the same (docs/method/gather.md).
struct Spiral {
    vec2 direction;
    float at;               // radius, or its square
    float step;
};

Spiral start_spiral(vec2 direction, float inner, float outer, int samples, float jitter) {
#if SPACING == 0
    float step = (outer - inner) / float(max(samples, 1));
    return Spiral(direction, inner + jitter * step, step);
#else
    float step = (outer * outer - inner * inner) / float(max(samples, 1));
    return Spiral(direction, inner * inner + jitter * step, step);
#endif
}

// The innermost part of the disc, whose light the upsampling leaves unfiltered: this share of its radius gets this
// share of its samples.
const float NEAR_RADIUS = 1.0 / 6.0;
#if SPACING == 0
const int NEAR_SAMPLES = 4;     // one in four
#else
const int NEAR_SAMPLES = 36;    // one in 36, like its area
#endif

// Light of the next `count` samples of the spiral.
void gather_samples(Receiver receiver, int count, inout Spiral spiral, inout Incoming light) {
    ivec2 size = size_surface();
    vec2 scale = frame.ray_scale * texel;
    vec2 center = vec2(receiver.px) + 0.5;
    float texel_area = scale.x * scale.y / PI;
#if VISIBILITY == 1
    Slicing slicing = make_slicing(load_depth_range(ivec2(0)));
    VoxelEnd here = voxel_end(slicing, receiver.px, receiver.position, receiver.normal, scale);
#endif
    for (int i = 0; i < count; ++i) {
#if SPACING == 0
        float radius = spiral.at;
        float texels = 2.0 * PI * radius * spiral.step;             // that this sample stands for
#else
        float radius = sqrt(spiral.at);
        float texels = PI * spiral.step;
#endif
        ivec2 at = ivec2(floor(center + spiral.direction * radius));
        spiral.direction = golden_rotation(spiral.direction);
        spiral.at += spiral.step;
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size)) || at == receiver.px) continue;
        Surface sender = load_surface(at);
        vec3 q = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), sender.view_depth);
        vec3 v = q - receiver.position;
        float distance_squared = dot(v, v);
        float sender_cos = -dot(sender.normal, v);                  // times the distance
        if (sender.view_depth <= 0.0 || sender_cos <= 0.0) continue;
        float inverse_distance = inversesqrt(distance_squared);
        // R^2 = cos' dA / pi, dA = a z^3 / |n . Q|. A surface seen at a grazing angle would count for infinitely
        // much: its cosine is held above 1 %.
        float facing = max(-dot(sender.normal, q), 0.01 * length(q));
        float depth = sender.view_depth;
        float disc = sender_cos * inverse_distance * texel_area * (depth * depth * depth) / facing;
#if FORM_FACTOR == 1
        float factor = texels * disc / distance_squared;
#elif SPACING == 0
        // The disc is the texel's own: a close sample stands for few texels, so the sum stays finite, and it tends to
        // the sum over all texels where a disc of the whole strip's area would stay below it.
        float factor = texels * disc / (distance_squared + disc);
#else
        // The disc is all that the sample stands for: what tames samples that are few near the receiver
        float factor = texels * disc / (distance_squared + texels * disc);
#endif
        vec3 radiance = load_radiance(at) * factor;
#if VISIBILITY == 1
        if (radiance == vec3(0.0)) continue;
        VoxelEnd there = voxel_end(slicing, at, q, sender.normal, scale);
        if (voxels_block(texture_voxels, texture_voxels_far, slicing, here, there)) continue;
#endif
        float receiver_cos = dot(receiver.normal, v) * inverse_distance;
        light.irradiance += radiance * max(receiver_cos, 0.0);
        light.back_irradiance += radiance * max(-receiver_cos, 0.0);
        float weight = receiver_cos > 0.0 ? inverse_distance * lobe_weight(radiance) : 0.0;
        light.directions += v * weight;
        light.weights += receiver_cos > 0.0 ? lobe_weight(radiance) : 0.0;
    }
}

Lobe lobe_of(Incoming light, vec3 normal) {
    return make_lobe(light.irradiance * PI, light.back_irradiance * PI, light.directions, light.weights, normal);
}

void shade(ivec2 px) {
    Lobe dark = Lobe(vec3(0.0), vec3(0.0), 0.0);
    out_gather = dark;
    out_near = dark;
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    Receiver receiver = Receiver(px, position_from_ray(ray, surface.view_depth), surface.normal);
    vec2 jitter = fract(interleaved_4x4(px) + frame.jitter);
    vec2 direction = direction_from_turn(jitter.x);
    Incoming none = Incoming(vec3(0.0), vec3(0.0), vec3(0.0), 0.0), near = none, light = none;
    // A single sample is a near one; the rest of the disc then goes without.
    int near_samples = near_field * ((frame.samples + NEAR_SAMPLES - 1) / NEAR_SAMPLES);
    float inner = near_field == 1 ? frame.radius * NEAR_RADIUS : inner_radius;
    // First what is near, where there is such a part, then the rest: one call, since compilers inline each one.
    for (int part = 1 - near_field; part < 2; ++part) {
        bool rest = part == 1;
        int count = rest ? frame.samples - near_samples : near_samples;
        Spiral spiral = start_spiral(direction, rest ? inner : 0.0, rest ? frame.radius : inner, count, jitter.y);
        Incoming sum = none;
        gather_samples(receiver, count, spiral, sum);
        direction = spiral.direction;
        if (rest) light = sum;
        else near = sum;
    }
    out_near = lobe_of(near, surface.normal);
    out_gather = lobe_of(light, surface.normal);
}
