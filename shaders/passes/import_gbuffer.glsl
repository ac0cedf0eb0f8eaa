// The G-buffer of another program, converted. DEPTH: 0 as the depth test left it, 1 metres along -Z.
// NORMALS: 0 in view space, 1 in world space. MOTION: 0 there is none and nothing but the camera moves,
// 1 displacement in image widths and heights, 2 with the ratio of depths in z.
#include "lib/normals.glsl"

// Distance along -Z, 0 for the background. unproject: view_depth = x / (depth + y).
float view_depth_of(float stored) {
#if DEPTH == 0
    float farthest = unproject.x < 0.0 ? 1.0 : 0.0;     // x > 0: the depth is reversed
    float view_depth = stored == farthest ? 0.0 : unproject.x / (stored + unproject.y);
#else
    float view_depth = stored;
#endif
    return view_depth > 0.0 && view_depth < 1e30 ? view_depth : 0.0;     // false for NaN, too
}

void shade(ivec2 px) {
    out_surface = Surface(0.0, vec3(0.0), 0.0);
    out_radiance = vec3(0.0);
    out_motion = vec4(0.0);
    float view_depth = view_depth_of(texelFetch(texture_host_depth, px, 0).r);
    if (view_depth == 0.0) return;
    vec2 center = vec2(px) + 0.5;
    vec3 position_vs = position_from_ray(ray_from_pixel(center, frame.ray_scale, frame.ray_origin), view_depth);
    vec3 n = texelFetch(texture_host_normal, px, 0).xyz;
#if NORMALS == 1
    n = mat3(frame.view_from_world) * n;
#endif
    vec3 to_camera = normalize(-position_vs);
    out_surface = Surface(view_depth, turned_to_camera(normalize_or(n, to_camera), to_camera), 1.0);
    out_radiance = texelFetch(texture_host_radiance, px, 0).rgb;

    vec3 before_vs = (frame.previous_view_from_view * vec4(position_vs, 1.0)).xyz;
    vec2 displacement;
    float depth_ratio = -before_vs.z / view_depth;
#if MOTION == 0
    vec4 before = frame.previous_clip_from_view * vec4(before_vs, 1.0);
    // Behind the old camera there is no old pixel: a displacement out of the image says so.
    displacement = before.w > 1e-6
        ? center / vec2(textureSize(texture_host_depth, 0)) - (before.xy / before.w * 0.5 + 0.5) : vec2(4.0);
#else
    vec4 motion = texelFetch(texture_host_motion, px, 0);
    displacement = motion.xy;
#if MOTION == 2
    depth_ratio = motion.z;
#endif
#endif
    out_motion = vec4(displacement, depth_ratio, encode_direction16(out_surface.normal));
}
