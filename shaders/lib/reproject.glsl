// Where a surface was in the last frame (Nehab et al. 2007). For passes that read `motion`, `previous_surface` (the
// surfaces of the last frame) and `history` (what is looked up there).

// The history at the place where a pixel's surface was, bilinear over the pixels that showed the same surface; false
// where none did.
bool find_history(ivec2 px, Surface surface, out vec4 history) {
    ivec2 size = size_surface();
    vec4 motion = load_motion(px);
    vec2 before = vec2(px) + 0.5 - motion.xy * (vec2(size) / frame.extent);
    float expected_depth = surface.view_depth * motion.z;
    vec3 expected = position_from_ray(ray_from_pixel(before, frame.previous_ray_scale, frame.previous_ray_origin),
                                      expected_depth);
    vec3 expected_normal = mat3(frame.previous_view_from_view) * surface.normal;

    vec2 corner = floor(before - 0.5);
    vec2 f = before - 0.5 - corner;
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 offset = ivec2(i & 1, i >> 1);
        ivec2 at = ivec2(corner) + offset;
        float weight = (offset.x == 1 ? f.x : 1.0 - f.x) * (offset.y == 1 ? f.y : 1.0 - f.y);
        bool inside = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size));
        ivec2 safe = clamp(at, ivec2(0), size - 1);
        Surface old = load_previous_surface(safe);
        vec2 ray = ray_from_pixel(vec2(safe) + 0.5, frame.previous_ray_scale, frame.previous_ray_origin);
        float off_plane = abs(dot(expected_normal, position_from_ray(ray, old.view_depth) - expected));
        bool same = inside && old.view_depth > 0.0 && off_plane < 0.01 * expected_depth
                    && dot(old.normal, expected_normal) > 0.8;
        if (same && weight > 0.0) {
            sum += load_history(safe) * weight;
            total += weight;
        }
    }
    history = sum / max(total, 0.01);
    return total >= 0.01;
}
