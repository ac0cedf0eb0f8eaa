// Reverse reprojection: each pixel looks up where its surface was in the last frame and goes on with the
// running mean that it finds there. alpha of the history: number of frames in the mean.

void shade(ivec2 px) {
    out_irradiance = vec4(0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec3 current = load_upsample(px);
    out_irradiance = vec4(current, 1.0);
    if (frame.history_frames == 0) return;

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
    if (total < 0.01) return;
    vec4 history = sum / total;

    // Light that changed, a moving lamp or a door that opens, must not be averaged away: where the new value,
    // which the upsampling has smoothed, is far from the mean, the mean is shortened.
    const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
    float new_light = dot(current, LUMINANCE), old_light = dot(history.rgb, LUMINANCE);
    float change = abs(new_light - old_light) / max(max(new_light, old_light), 1e-6);
    float longest = mix(float(frame.history_frames), 2.0, smoothstep(0.5, 0.9, change));
    float count = min(history.a + 1.0, longest);
    out_irradiance = vec4(mix(history.rgb, current, 1.0 / count), count);
}
