// Monte-Carlo gather of one level: a disc at the starting level, a ring beyond. FORM_FACTOR: 0 disc, 1 point.
#include "lib/lobe.glsl"
#include "lib/sampling.glsl"

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

// Walks the sample spiral. Samples are spaced evenly in radius, not in area: near senders, whose light varies
// fastest, get most of them, and each sample stands for the area of its own strip (docs/method/gather.md).
struct Spiral {
    vec2 direction;
    float radius;
    float step;
};

// The innermost part of the disc, whose light the upsampling leaves unfiltered: this share of its radius gets this
// share of its samples.
const float NEAR_RADIUS = 1.0 / 6.0;
const int NEAR_SAMPLES = 4;     // one in four

// Light of the next `count` samples of the spiral.
void gather_samples(Receiver receiver, int count, inout Spiral spiral, inout Incoming light) {
    ivec2 size = size_surface();
    vec2 scale = frame.ray_scale * texel;
    vec2 center = vec2(receiver.px) + 0.5;
    float texel_area = scale.x * scale.y / PI;
    for (int i = 0; i < count; ++i) {
        ivec2 at = ivec2(floor(center + spiral.direction * spiral.radius));
        float texels = 2.0 * PI * spiral.radius * spiral.step;      // that this sample stands for
        spiral.direction = golden_rotation(spiral.direction);
        spiral.radius += spiral.step;
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size)) || at == receiver.px) continue;
        Surface sender = load_surface(at);
        vec3 q = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), sender.view_depth);
        vec3 v = q - receiver.position;
        float distance_squared = dot(v, v);
        float sender_cos = -dot(sender.normal, v);                  // times the distance
        if (sender.view_depth <= 0.0 || sender_cos <= 0.0) continue;
        float inverse_distance = inversesqrt(distance_squared);
        // R^2 = cos' dA / pi of the texel's own disc, dA = a z^3 / |n . Q|. A surface seen at a grazing angle would
        // count for infinitely much: its cosine is held above 1 %.
        float facing = max(-dot(sender.normal, q), 0.01 * length(q));
        float depth = sender.view_depth;
        float disc = sender_cos * inverse_distance * texel_area * (depth * depth * depth) / facing;
#if FORM_FACTOR == 0
        float factor = texels * disc / (distance_squared + disc);
#else
        float factor = texels * disc / distance_squared;
#endif
        vec3 radiance = load_radiance(at) * factor;
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
#ifdef NEAR_FIELD
    out_near = dark;
#endif
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    Receiver receiver = Receiver(px, position_from_ray(ray, surface.view_depth), surface.normal);
    vec2 jitter = fract(interleaved_4x4(px) + frame.jitter);
    vec2 direction = direction_from_turn(jitter.x);
    Incoming none = Incoming(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
#ifdef NEAR_FIELD
    int near_samples = (frame.samples + NEAR_SAMPLES - 1) / NEAR_SAMPLES, samples = frame.samples - near_samples;
    float inner = frame.radius * NEAR_RADIUS;
    float near_step = inner / float(near_samples);
    Spiral spiral = Spiral(direction, jitter.y * near_step, near_step);
    Incoming near = none;
    gather_samples(receiver, near_samples, spiral, near);
    out_near = lobe_of(near, surface.normal);
    direction = spiral.direction;
#else
    int samples = frame.samples;
    float inner = inner_radius;
#endif
    // A single sample is a near one; the rest of the disc then goes without.
    float step = (frame.radius - inner) / float(max(samples, 1));
    Spiral outer = Spiral(direction, inner + jitter.y * step, step);
    Incoming light = none;
    gather_samples(receiver, samples, outer, light);
    out_gather = lobe_of(light, surface.normal);
}
