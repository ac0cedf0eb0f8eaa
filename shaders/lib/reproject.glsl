// Where a surface was in the last frame (Nehab et al. 2007). For passes that read `motion` and `previous_surface`, the
// surfaces of the last frame; what they look up there are three texels with weights. STILL: nothing has moved, and the
// texel itself is all; neither of the two is read.
#include "lib/taps.glsl"

#ifdef STILL
const int TAPS = 1;
#else
const int TAPS = 3;
#endif

struct Previous {
    ivec2 at[TAPS];
    vec3 weights;       // 0 for those that showed another surface
    vec3 facing;        // cosines between the normals
    vec3 normals[TAPS]; // of the last frame, in its view space
};

#ifdef STILL
Previous find_previous(ivec2 px, Surface surface) {
    return Previous(ivec2[](px), vec3(1.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3[](surface.normal));
}
#else
Previous find_previous(ivec2 px, Surface surface) {
    ivec2 last = size_surface() - 1;
    vec4 motion = load_motion(px);
    Previous found;
    vec2 before = vec2(px) + 0.5 - motion.xy * (vec2(size_surface()) / frame.extent);
    float expected_depth = surface.view_depth * motion.z;
    vec3 expected_normal = mat3(frame.previous_view_from_view) * surface.normal;
    vec2 ray = ray_from_pixel(before, frame.previous_ray_scale, frame.previous_ray_origin);
    // Distance to the expected tangent plane of a point that is seen `apart` pixels from there: linear in the ray
    float slant = dot(expected_normal, vec3(ray, -1.0)), offset = expected_depth * slant;
    vec2 slope = expected_normal.xy * frame.previous_ray_scale;
    Taps taps = nearest_taps(before);
    for (int i = 0; i < 3; ++i) {
        found.at[i] = clamp(taps.at[i], ivec2(0), last);
        Surface old = load_previous_surface(found.at[i]);
        float off_plane = abs(old.view_depth * (slant + dot(slope, taps.apart[i])) - offset);
        bool same = found.at[i] == taps.at[i] && old.view_depth > 0.0 && off_plane < 0.01 * expected_depth;
        found.weights[i] = same ? taps.weights[i] : 0.0;
        found.facing[i] = dot(old.normal, expected_normal);
        found.normals[i] = old.normal;
    }
    return found;
}
#endif

// Sum of the weights below which nothing was found.
const float LEAST_FOUND = 0.01;

// The weights of those whose normals are alike, too. least: cosine.
vec3 alike(Previous previous, float least) {
    return vec3(previous.facing.x > least ? previous.weights.x : 0.0,
                previous.facing.y > least ? previous.weights.y : 0.0,
                previous.facing.z > least ? previous.weights.z : 0.0);
}

#ifdef HAS_HISTORY
// The mean of `history` over the texels that showed the same surface; false where none did. factors: on their light.
bool find_history(Previous previous, vec3 factors, out vec4 history) {
    vec3 weights = alike(previous, 0.8);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < TAPS; ++i) {
        vec4 found = load_history(previous.at[i]);
        found.rgb *= factors[i];
        sum += weights[i] > 0.0 ? found * weights[i] : vec4(0.0);   // what is refused may be no number
    }
    float total = weights.x + weights.y + weights.z;
    history = sum / max(total, LEAST_FOUND);
    return total >= LEAST_FOUND;
}
#endif
