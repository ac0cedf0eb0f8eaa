// How far our irradiance is from a reference, as a colour. Relative to the reference's mean over the image, the mean of
// the channels. `block`: pixels of the squares whose means are compared, aligned to the upper left corner as in the tables.
//   first: pixel where the image begins in what was rendered; limit: the error at the end of the scale;
//   is_signed: the scale goes from -limit to limit, else from 0.
#include "lib/as_vec4.glsl"

const vec3 BACKGROUND = vec3(0.16);

vec3 color_of(float place) {
    float at = clamp(place, 0.0, 1.0) * 4.0;
    int below = min(int(at), 3);
    return mix(stops[below], stops[below + 1], at - float(below));
}

void shade(ivec2 px) {
    out_display = vec4(BACKGROUND, 1.0);
    if (load_surface(px + first).view_depth <= 0.0) return;
    ivec2 from_top = ivec2(px.x, image_size.y - 1 - px.y) / block * block;
    vec3 difference = vec3(0.0);
    float pixels = 0.0;
    for (int y = 0; y < block; ++y)
        for (int x = 0; x < block; ++x) {
            ivec2 place = from_top + ivec2(x, y);
            if (any(greaterThanEqual(place, image_size))) continue;
            ivec2 at = ivec2(place.x, image_size.y - 1 - place.y) + first;
            if (load_surface(at).view_depth <= 0.0) continue;
            difference += as_vec4(load_ours(at)).rgb - load_reference(at).rgb;
            pixels += 1.0;
        }
    float error = dot(difference, vec3(1.0 / 3.0)) / (pixels * mean);
    float place = is_signed == 1 ? 0.5 + 0.5 * error / limit : abs(error) / limit;
    out_display = vec4(color_of(place), 1.0);
}
