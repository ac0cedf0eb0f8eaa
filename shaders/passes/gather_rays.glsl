// What rays know better than horizons and texels: of what each part of the rows has found one sample is drawn, in proportion
// to what it may bring; the pixel that the image has there, and a ray, tell what it really brings, and the difference is
// added for all that it was drawn from. In the mean that makes the sum over all pixels with true visibility; where rows are
// right already the difference is small, and with it the noise. Needs what lib/scene_rays.glsl needs, and the reads
// `image_surface`, `image_radiance` and `motion`.
//   random_seed: of the frame.
#include "lib/hash.glsl"
#include "lib/scene_rays.glsl"

// Samples one after the other, of which one is kept (weighted reservoir sampling, Chao 1982).
struct Draw {
    float total;        // of the weights so far
    float weight;       // of the one that was kept
    vec2 place;         // in texels
    float texels;       // that it stands for
};

const Draw NOTHING_DRAWN = Draw(0.0, 0.0, vec2(0.0), 0.0);
const int SEEN = 0, HIDDEN = 1, SEEN_NEAR = 2, DRAWS = 3;

// Light that a sample may bring, visible or not. Its pixel may face elsewhere than its texel, so none gets too little.
const float BACK = 0.25, SLOPE = 0.05;

float draw_weight(Receiver receiver, Sender sender, vec3 radiance, float texels) {
    float cosine = dot(receiver.normal, sender.offset) * sender.inverse_distance;
    Disc disc = disc_of_texel(sender, frame.ray_scale * texel);
    float depth = sender.view_depth;
    disc.above += SLOPE * sqrt(sender.distance_squared) * (frame.ray_scale.x * frame.ray_scale.y * texel * texel * (1.0 / PI)) * (depth * depth * depth);
    return lobe_weight(radiance) * form_factor(sender, disc, texels) * (max(cosine, -BACK * cosine) + SLOPE);
}

void draw(float weight, vec2 place, float texels, inout uint random, inout Draw drawn) {
    drawn.total += weight;
    random = next_random(random);
    if (weight > 0.0 && unit_float(random) * drawn.total < weight)
        drawn = Draw(drawn.total, weight, place, texels);
}

// Where the image has the receiver's surface: at one of the texel's pixels, by chance.
vec3 place_of_receiver(Receiver receiver, inout uint random) {
    int width = int(texel);
    float depth = -receiver.position.z;
    float reach = depth * (1e-3 + 0.5 * texel * max(frame.ray_scale.x, frame.ray_scale.y));
    for (int i = 0; i < 4; ++i) {
        random = hash(random);
        ivec2 at = receiver.px * width + ivec2(int(random & 0xFFFFu) % width, int(random >> 16) % width);
        if (!is_on_screen(at, size_image_surface())) continue;
        Surface surface = load_image_surface(at);
        vec3 position = position_from_ray(ray_from_pixel(vec2(at) + 0.5, frame.ray_scale, frame.ray_origin),
                                          surface.view_depth);
        if (surface.view_depth > 0.0 && dot(surface.normal, receiver.normal) > 0.5
            && abs(dot(receiver.normal, position - receiver.position)) < reach) return position;
    }
    return receiver.position;
}

// Adds what the drawn sample really brings, less what was counted, for all that it was drawn from.
void correct(Receiver receiver, Draw drawn, bool seen, inout uint random, inout Incoming change) {
    if (drawn.weight <= 0.0) return;
    float share = drawn.total / drawn.weight;
    if (seen) {
        ivec2 at = ivec2(floor(drawn.place));
        Sender counted = look_at_place(receiver, at, drawn.place);
        receive(receiver, counted, load_radiance(at) * (-share * form_factor(counted, drawn.texels)), change);
    }
    ivec2 pixel = ivec2(floor(drawn.place * texel));
    if (is_on_screen(pixel, size_image_surface())) {
        Surface surface = load_image_surface(pixel);
        surface.normal = decode_direction16(load_motion(pixel).w);
        vec3 own = place_of_receiver(receiver, random);
#if MODE == 0 || MODE == 3
        receiver.position = own;
#endif
        vec3 position = position_from_ray(ray_from_pixel(vec2(pixel) + 0.5, frame.ray_scale, frame.ray_origin),
                                          surface.view_depth);
        Sender sender = sender_at(receiver, pixel, surface, position);
        vec3 radiance = load_image_radiance(pixel);
        if (is_seen(sender) && radiance != vec3(0.0)) {
#if MODE == 2
            sender = look_at_place(receiver, ivec2(floor(drawn.place)), drawn.place);
            radiance = load_radiance(ivec2(floor(drawn.place))) * (share * form_factor(sender, drawn.texels));
#else
            float factor = form_factor(sender, disc_of_texel(sender, frame.ray_scale), drawn.texels * texel * texel);
#if MODE == 3
            float cosine = dot(receiver.normal, sender.offset) * sender.inverse_distance;
            factor = min(factor, float(RATIO)*drawn.weight / max(lobe_weight(radiance) * abs(cosine), 1e-20));
#endif
            radiance *= share * factor;
#endif
//sender, disc_of_texel(sender, frame.ray_scale), drawn.texels * texel * texel);
            // Both ends stand off their surfaces, towards the camera
            if (radiance != vec3(0.0) && !is_blocked(to_world(own * (1.0 - RAY_LIFT)), to_world(position * (1.0 - RAY_LIFT))))
                receive(receiver, sender, radiance, change);
        }
    }
}
