// Monte-Carlo gather of one level: a disc at the starting level, a ring beyond. FORM_FACTOR: 0 disc, 1 point.
#include "lib/lobe.glsl"
#include "lib/sampling.glsl"

const float PI = 3.141592653589793;

#ifndef VARIANT
#define VARIANT 1
#endif
#if VARIANT==0
#define TA (texel_area*texels)
#define W 1.0
#else
#define TA texel_area
#define W texels
#endif
void shade(ivec2 px) {
    out_gather = Lobe(vec3(0.0), vec3(0.0), 0.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth <= 0.0) return;
    ivec2 size = size_surface();
    vec2 scale = frame.ray_scale * texel;
    vec3 p = position_from_ray(ray_from_pixel(vec2(px) + 0.5, scale, frame.ray_origin), receiver.view_depth);

    // Area on the plane z = 1 that a sample stands for, over pi.
    float inner = inner_radius * inner_radius, outer = frame.radius * frame.radius;
    float texel_area = scale.x * scale.y / PI;
    vec2 jitter = fract(interleaved_4x4(px) + frame.jitter);
    vec2 direction = direction_from_turn(jitter.x);
    vec2 center = vec2(px) + 0.5;
    vec3 sum = vec3(0.0), back = vec3(0.0), directions = vec3(0.0);
    float weights = 0.0;
    float radius_step = (frame.radius - inner_radius) / float(frame.samples);
    float radius = inner_radius + jitter.y * radius_step;

    for (int i = 0; i < frame.samples; ++i) {
        ivec2 at = ivec2(floor(center + direction * radius));
        float texels = 2.0 * PI * radius * radius_step;
        direction = golden_rotation(direction);
        radius += radius_step;
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size)) || at == px) continue;
        Surface sender = load_surface(at);
        vec3 q = position_from_ray(ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin), sender.view_depth);
        vec3 v = q - p;
        float distance_squared = dot(v, v);
        float receiver_cos = dot(receiver.normal, v);       // both times the distance
        float sender_cos = -dot(sender.normal, v);
        if (sender.view_depth <= 0.0 || sender_cos <= 0.0) continue;
        // dA = area z^3 / |n . Q|: surface area behind the sample's pixels. A surface seen at a grazing angle
        // would count for infinitely much: its cosine is held above 1 %.
        float facing = max(-dot(sender.normal, q), 0.01 * length(q));
        float inverse_distance = inversesqrt(distance_squared);
        float depth = sender.view_depth;
        float disc = sender_cos * inverse_distance * TA * depth * depth * depth / facing;   // R^2 = cos' dA / pi
#if FORM_FACTOR == 0
        float factor = W * disc / (distance_squared + disc);
#else
        float factor = W * disc / distance_squared;
#endif
        vec3 radiance = load_radiance(at) * factor;
        float weight = radiance.r + radiance.g + radiance.b;
        if (receiver_cos > 0.0) {
            sum += radiance * (receiver_cos * inverse_distance);
            directions += v * (inverse_distance * weight);
            weights += weight;
        } else {
            back -= radiance * (receiver_cos * inverse_distance);
        }
    }
    out_gather = make_lobe(sum * PI, back * PI, weights > 0.0 ? directions / weights : receiver.normal * 0.66, receiver.normal);
}
