// What rays know better than horizons, and pixels better than texels. Of the samples of some rows that horizons call visible, and
// of those that they call hidden, one each is drawn, in proportion to what it may bring. The pixel that the image has there
// and a ray tell what it really brings, and that stands for all that it was drawn from. In the mean this is the sum over all
// pixels with true visibility, but for the limit below and for sums that come out negative and are cut off. Where horizons are
// right there is no noise from visibility: all of the visible ones are seen, none of the hidden ones. Needs what lib/scene_rays.glsl needs, and the reads `image_surface`,
// `image_radiance` and `motion`.
//   ray_groups: of rows. OF_ROW: how often they draw.   random_seed: of the frame.
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

// What horizons say of a sample. What is near is a light of its own, which is not denoised.
const int SEEN = 0, HIDDEN = 1, SEEN_NEAR = 2, KINDS = 3, DRAWS = KINDS * OF_ROW;

// A pixel may lie and face otherwise than its texel, so none gets too small a weight, and none brings more than so many
// times what the sample was drawn for: few such would be seen as dots.
const float BACK = 0.25, SLOPE = 0.2, MOST = 40.0;
// What is near is not denoised: more than so many times would be a dot, and goes to what is.
const float MOST_NEAR = 3.0;

// In proportion to what a sample would bring if it is seen.
float factor_to_draw(Receiver receiver, Sender sender, float texels) {
    float cosine = dot(receiver.normal, sender.offset) * sender.inverse_distance;
    sender.normal -= sender.offset * (SLOPE * sender.inverse_distance);
    return form_factor(sender, texels) * (max(cosine, -BACK * cosine) + SLOPE);
}

// Whether from the surface that the vote kept or from where the texel is brightest: light on a narrow edge comes from there.
float draw_weight(Receiver receiver, Sender sender, vec3 radiance, float texels) {
    float factor = factor_to_draw(receiver, sender, texels);
#ifdef HAS_BRIGHTEST
    Surface surface = load_brightest(sender.px);
    vec2 ray = ray_from_pixel(vec2(sender.px) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    Sender bright = sender_at(receiver, sender.px, surface, position_from_ray(ray, surface.view_depth));
    if (is_seen(bright)) factor = max(factor, factor_to_draw(receiver, bright, texels));
#endif
    return lobe_weight(radiance) * factor;
}

void draw(float weight, vec2 place, float texels, inout uint random, inout Draw drawn) {
    drawn.total += weight;
    random = next_random(random);
    if (weight > 0.0 && unit_float(random) * drawn.total < weight) drawn = Draw(drawn.total, weight, place, texels);
}

vec3 position_of_pixel(ivec2 pixel, float view_depth) {
    return position_from_ray(ray_from_pixel(vec2(pixel) + 0.5, frame.ray_scale, frame.ray_origin), view_depth);
}

// Where the image has the receiver's surface: at one of its texel's pixels, by chance. A texel's own place is made up by the
// mipmaps and may lie inside of a wall.
vec3 place_of_receiver(Receiver receiver, inout uint random) {
    int width = int(texel);
    float depth = -receiver.position.z;
    float reach = depth * (1e-3 + 0.5 * texel * max(frame.ray_scale.x, frame.ray_scale.y));
    for (int i = 0; i < 4; ++i) {
        random = hash(random);
        ivec2 at = receiver.px * width + ivec2(int(random & 0xFFFFu) % width, int(random >> 16) % width);
        if (!is_on_screen(at, size_image_surface())) continue;
        Surface surface = load_image_surface(at);
        vec3 position = position_of_pixel(at, surface.view_depth);
        if (surface.view_depth > 0.0 && dot(surface.normal, receiver.normal) > 0.5
            && abs(dot(receiver.normal, position - receiver.position)) < reach) return position;
    }
    return receiver.position;
}

// Off its surface, towards the camera.
vec3 ray_end(vec3 position) { return to_world(position * (1.0 - RAY_LIFT)); }

struct PixelDraw {
    ivec2 at;
    vec3 radiance;
    float share;        // one over the probability
};

// One of a texel's pixels, in proportion to its light: sunlit edges are a pixel wide, and few draws would meet them.
PixelDraw draw_pixel(ivec2 texel_at, inout uint random) {
    int width = int(texel);
    PixelDraw drawn = PixelDraw(ivec2(0), vec3(0.0), 0.0);
    float total = 0.0, kept = 0.0;
    random = hash(random);
    int i = 0;
    do {
        ivec2 at = texel_at * width + ivec2(i % width, i / width);
        vec3 radiance = is_on_screen(at, size_image_surface()) ? load_image_radiance(at) : vec3(0.0);
        float weight = lobe_weight(radiance);
        total += weight;
        random = next_random(random);
        if (weight > 0.0 && unit_float(random) * total < weight) {
            drawn.at = at;
            drawn.radiance = radiance;
            kept = weight;
        }
    } while (++i < width * width);
    drawn.share = kept > 0.0 ? total / kept : 0.0;
    return drawn;
}

// What is missing in the light of all samples that one was drawn from. counted: so far each counts as its texel brings.
// most: times what it was drawn for, beyond which it goes to `rest`.
Incoming missing_light(Receiver receiver, Draw drawn, bool counted, float most, inout uint random, inout Incoming rest) {
    Incoming missing = NO_LIGHT;
    if (drawn.weight <= 0.0) return missing;
    float share = drawn.total / drawn.weight;
    if (counted) {
        ivec2 at = ivec2(floor(drawn.place));
        Sender sender = look_at_place(receiver, at, drawn.place);
        receive(receiver, sender, load_radiance(at) * (-share * form_factor(sender, drawn.texels)), missing);
    }
    PixelDraw pixel = draw_pixel(ivec2(floor(drawn.place)), random);
    if (pixel.share <= 0.0) return missing;
    Surface surface = load_image_surface(pixel.at);
    surface.normal = decode_direction16(load_motion(pixel.at).w);
    receiver.position = place_of_receiver(receiver, random);
    Sender sender = sender_at(receiver, pixel.at, surface, position_of_pixel(pixel.at, surface.view_depth));
    if (!is_seen(sender)) return missing;
    float factor = pixel.share * form_factor(sender, disc_of_texel(sender, frame.ray_scale), drawn.texels);
    float cosine = abs(dot(receiver.normal, sender.offset)) * sender.inverse_distance;
    float expected = drawn.weight / max(lobe_weight(pixel.radiance) * cosine, 1e-20);
    factor = min(factor, MOST * expected);
    if (factor > 0.0 && !is_blocked(ray_end(receiver.position), ray_end(sender.position))) {
        float usual = min(factor, most * expected);
        receive(receiver, sender, pixel.radiance * (share * usual), missing);
        receive(receiver, sender, pixel.radiance * (share * (factor - usual)), rest);
    }
    return missing;
}
