// Where a surface was in the last frame (Nehab et al. 2007). For passes that read `motion`, `previous_surface` (the
// surfaces of the last frame) and `history` (what is looked up there).

// The history at the place where a pixel's surface was, bilinear over the pixels that showed the same surface; false
// where none did.
bool find_history(ivec2 px, Surface surface, out vec4 history) {
    ivec2 size = size_surface();
    vec4 motion = load_motion(px);
    vec2 before = vec2(px) + 0.5 - motion.xy * (vec2(size) / frame.extent);
    float expected_depth = surface.view_depth * motion.z;
    vec3 expected_normal = mat3(frame.previous_view_from_view) * surface.normal;
    vec2 ray = ray_from_pixel(before, frame.previous_ray_scale, frame.previous_ray_origin);
    float offset = dot(expected_normal, position_from_ray(ray, expected_depth));

    vec2 corner = floor(before - 0.5);
    vec2 f = before - 0.5 - corner;
    ivec2 first = ivec2(corner);
    float slant = dot(expected_normal, vec3(ray, -1.0));
    vec2 slope = expected_normal.xy * frame.previous_ray_scale;
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 at = first + ivec2(i & 1, i >> 1), safe = clamp(at, ivec2(0), size - 1);
        vec2 apart = vec2(i & 1, i >> 1) - f;
        Surface old = load_previous_surface(safe);
        float off_plane = abs(old.view_depth * (slant + dot(slope, apart)) - offset);
        // Background has no normal
        bool same = at == safe && off_plane < 0.01 * expected_depth && dot(old.normal, expected_normal) > 0.8;
        float weight = same ? (1.0 - abs(apart.x)) * (1.0 - abs(apart.y)) : 0.0;
        sum += load_history(safe) * weight;
        total += weight;
    }
    history = sum / max(total, 0.01);
    return total >= 0.01;
}
