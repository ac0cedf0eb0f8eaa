// Where a surface was in the last frame (Nehab et al. 2007). For passes that read `motion`, `previous_surface` (the
// surfaces of the last frame) and `history` (what is looked up there).

#ifndef HISTORY_AT
#define HISTORY_AT(px) load_history(px)
#endif

// Pixels by which the surface at a pixel has moved in the image since the last frame.
vec2 moved_pixels(vec4 motion) { return motion.xy * (vec2(size_surface()) / frame.extent); }

// The history at the place where a pixel's surface was: of the nearest pixel there and its nearest neighbours along
// either axis, with the weights that reproduce what is linear over the image, those that showed the same surface; false
// where none did. alike: least cosine between the normals.
bool find_history(ivec2 px, Surface surface, float alike, out vec4 history) {
    ivec2 last = size_surface() - 1;
    vec4 motion = load_motion(px);
    vec2 before = vec2(px) + 0.5 - moved_pixels(motion);
    float expected_depth = surface.view_depth * motion.z;
    vec3 expected_normal = mat3(frame.previous_view_from_view) * surface.normal;
    vec2 ray = ray_from_pixel(before, frame.previous_ray_scale, frame.previous_ray_origin);
    // Distance to the expected tangent plane of a point that is seen `apart` pixels from there: linear in the ray
    float slant = dot(expected_normal, vec3(ray, -1.0)), offset = expected_depth * slant;
    vec2 slope = expected_normal.xy * frame.previous_ray_scale;

    vec2 own = floor(before), f = before - own - 0.5;
    ivec2 first = ivec2(own);
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int i = 0; i < 3; ++i) {
        ivec2 step = ivec2(i == 1 ? (f.x < 0.0 ? -1 : 1) : 0, i == 2 ? (f.y < 0.0 ? -1 : 1) : 0);
        ivec2 at = first + step, safe = clamp(at, ivec2(0), last);
        Surface old = load_previous_surface(safe);
        float off_plane = abs(old.view_depth * (slant + dot(slope, vec2(step) - f)) - offset);
        bool same = at == safe && old.view_depth > 0.0 && off_plane < 0.01 * expected_depth
                    && dot(old.normal, expected_normal) > alike;
        float weight = i == 0 ? 1.0 - abs(f.x) - abs(f.y) : i == 1 ? abs(f.x) : abs(f.y);
        weight = same ? weight : 0.0;
        vec4 found = HISTORY_AT(safe);
        sum += weight > 0.0 ? found * weight : vec4(0.0);   // what is refused may be no number
        total += weight;
    }
    history = sum / max(total, 0.01);
    return total >= 0.01;
}
