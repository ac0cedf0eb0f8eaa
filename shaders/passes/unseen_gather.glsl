// Light from the unseen senders: each ray goes to one of several candidates, in proportion to what they would bring.
//   side: texels per side of the senders.
#include "lib/hash.glsl"
#include "lib/lobe.glsl"
#include "lib/triangle_tree.glsl"

const float PI = 3.141592653589793;
const float LIFT_ = 3e-4;       // scene/triangles.py

struct Candidate {
    vec3 position;
    vec3 normal;
    vec3 direction;     // from the receiver
    float cosine;       // at the receiver, negative for what arrives at its back
    vec3 light;         // power times form factor, without the receiver's cosine
};

Candidate look_at_sender(ivec2 at, vec3 position) {
    vec4 place = load_position(at), power = load_power(at);
    Candidate c;
    c.position = place.xyz;
    vec3 offset = place.xyz - position;
    float squared = max(dot(offset, offset), 1e-20);
    c.direction = offset * inversesqrt(squared);
    c.normal = decode_direction16(power.w);
    float sender_cos = max(-dot(c.normal, c.direction), 0.0);
    // Point to disc, as in the gather: finite at contact
    c.light = power.rgb * (sender_cos / (squared + sender_cos * place.w / PI));
    c.cosine = 0.0;
    return c;
}

bool blocked(vec3 from, vec3 to) {
    vec3 a = (frame.world_from_view * vec4(from, 1.0)).xyz, b = (frame.world_from_view * vec4(to, 1.0)).xyz;
    return triangles_block(texture_nodes, texture_triangles,
#ifdef MASKED
                           texture_corners, texture_masks, texture_alphas,
#endif
                           node_count, a, b);
}

// What a back gets counts for less: few pixels ask for it.
const float BACK = 0.25;

void shade(ivec2 px) {
    out_unseen = Lobe(vec3(0.0), vec3(0.0), 0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    vec3 position = position_from_ray(ray, surface.view_depth);
    uint random = hash(uint(px.x + (px.y << 14)) ^ hash(uint(random_seed) * 2654435761u + 17u));
    vec3 irradiance = vec3(0.0), back = vec3(0.0), directions = vec3(0.0);
    float weights = 0.0;
    int count = side * side;
    for (int r = 0; r < rays; ++r) {
        Candidate chosen;
        chosen.light = vec3(0.0);
        float total = 0.0, chosen_weight = 0.0;
        for (int i = 0; i < candidates; ++i) {
            random = hash(random);
            // One of each part of the senders, whose neighbours lie close together
            float at = (float(i) + unit_float(random)) / float(candidates);
            int index = min(int(at * float(count)), count - 1);
            Candidate c = look_at_sender(ivec2(index % side, index / side), position);
            c.cosine = dot(surface.normal, c.direction);
            float weight = dot(c.light, vec3(1.0 / 3.0)) * max(c.cosine, -BACK * c.cosine);
            total += weight;
            random = hash(random);
            if (weight > 0.0 && unit_float(random) * total < weight) {
                chosen = c;
                chosen_weight = weight;
            }
        }
        if (chosen_weight <= 0.0) continue;
        // Off both surfaces: the receiver's, as in the references, towards the camera
        vec3 from = position * (1.0 - LIFT_) + surface.normal * (sign(chosen.cosine) * LIFT_ * surface.view_depth);
        vec3 to = chosen.position + chosen.normal * (LIFT_ * surface.view_depth);
        if (blocked(from, to)) continue;
        // Each candidate stands for count / candidates senders
        vec3 light = chosen.light * (total / chosen_weight * float(count) / float(candidates * rays));
        irradiance += light * max(chosen.cosine, 0.0);
        back += light * max(-chosen.cosine, 0.0);
        float weight = chosen.cosine > 0.0 ? lobe_weight(light) : 0.0;
        directions += chosen.direction * weight;
        weights += weight;
    }
    out_unseen = make_lobe(irradiance, back, directions, weights, surface.normal);
}
