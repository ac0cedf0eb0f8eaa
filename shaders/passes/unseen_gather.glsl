// Light from what the image does not show. Far from the receiver: rays to drawn senders, each to one of several candidates,
// in proportion to what they would bring. Closer than `near_reach`, where senders are too far apart: rays of random directions,
// and the light of what they meet.
//   side: texels per side of the senders.
#include "lib/incoming.glsl"
#include "lib/unseen.glsl"

void receive(vec3 direction, float cosine, vec3 light, inout Incoming sum) {
    float weight = receive(cosine, light, sum);
    sum.directions += direction * weight;
}

struct Candidate {
    vec3 position;
    vec3 normal;
    vec3 direction;     // from the receiver
    vec3 light;         // power times form factor, without the receiver's cosine
};

Candidate look_at_sender(ivec2 at, vec3 position) {
    vec4 place = load_position(at), power = load_power(at);
    vec3 offset = place.xyz - position;
    float squared = dot(offset, offset);
    vec3 direction = offset * inversesqrt(max(squared, 1e-20)), normal = decode_direction16(power.w);
    float factor = squared < near_reach * near_reach ? 0.0 : max(-dot(normal, direction), 0.0) / squared;
    return Candidate(place.xyz, normal, direction, power.rgb * factor);
}

// What a back gets counts for less: few pixels ask for it.
const float BACK = 0.25;

float importance(Candidate c, vec3 normal) {
    float cosine = dot(normal, c.direction);
    return dot(c.light, vec3(1.0 / 3.0)) * max(cosine, -BACK * cosine);
}

void gather_far(vec3 position, vec3 normal, float lift, float share, inout uint random, inout Incoming sum) {
    Candidate chosen;
    float total = 0.0, chosen_weight = 0.0;
    int count = side * side;
    random = hash(random);
    int i = 0;
    do {
        random = next_random(random);
        // One of each part of the senders, whose neighbours lie close together
        float at = (float(i) + unit_float(random)) / float(candidates);
        int index = min(int(at * float(count)), count - 1);
        Candidate c = look_at_sender(ivec2(index % side, index / side), position);
        float weight = importance(c, normal);
        total += weight;
        random = next_random(random);
        if (weight > 0.0 && unit_float(random) * total < weight) {
            chosen = c;
            chosen_weight = weight;
        }
    } while (++i < candidates);
    if (chosen_weight <= 0.0) return;
    float cosine = dot(normal, chosen.direction);
    vec3 from = to_world(position + normal * (sign(cosine) * lift)), to = to_world(chosen.position + chosen.normal * max(lift, 1e-6 * extent));
    if (is_blocked(from, to)) return;
    // Each candidate stands for count / candidates senders
    receive(chosen.direction, cosine, chosen.light * (total / chosen_weight * float(count) / float(candidates) * share), sum);
}

void gather_near(vec3 position, vec3 normal, float lift, float share, inout uint random, inout Incoming sum) {
    random = hash(random);
    float u = unit_float(random);
    random = hash(random);
    vec3 direction = cosine_direction(normal, u, unit_float(random));
    vec3 radiance = unseen_radiance(position + normal * lift, direction * near_reach, random);
    // Density: cosine over pi
    float cosine = max(dot(normal, direction), 1e-4);
    receive(direction, cosine, radiance * (PI / cosine * share), sum);
}

void shade(ivec2 px) {
    out_unseen = Lobe(vec3(0.0), vec3(0.0), 0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    // As in the references, off its surface towards the camera
    vec3 position = position_from_ray(ray, surface.view_depth) * (1.0 - RAY_LIFT);
    float lift = RAY_LIFT * surface.view_depth, share = 1.0 / float(rays);
    uint random = hash(uint(px.x + (px.y << 14)) ^ hash(uint(random_seed) * 2654435761u + 17u));
    Incoming sum = NO_LIGHT;
    int r = 0;
    do {
        gather_far(position, surface.normal, lift, share, random, sum);
        gather_near(position, surface.normal, lift, share, random, sum);
    } while (++r < rays);
    out_unseen = make_lobe(sum.irradiance, sum.back_irradiance, sum.directions, sum.weights, surface.normal);
}
