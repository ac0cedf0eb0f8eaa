// Irradiance of one level: the level's own gather, denoised, plus the sum of all coarser levels brought up by
// two. Both filters are cross-bilateral: a tap counts by its kernel weight, the agreement of normals and its
// distance to the receiver's tangent plane. UPSAMPLING: 0 bilateral, 1 nearest.

// Distance to the plane at which a tap's weight is halved, relative to the view depth.
const float PLANE_TOLERANCE = 0.01;

float agreement(Surface receiver, vec3 p, Surface tap, vec2 tap_ray) {
    float facing = max(dot(receiver.normal, tap.normal), 0.0);
    facing *= facing;
    facing *= facing;
    float off_plane = dot(receiver.normal, position_from_ray(tap_ray, tap.view_depth) - p)
                    / (receiver.view_depth * PLANE_TOLERANCE);
    return tap.view_depth > 0.0 ? facing * facing / (1.0 + off_plane * off_plane) : 0.0;
}

#ifdef HAS_GATHER
// The gather's rotations repeat every 4 texels: this window sees each of the 16 once, whatever its phase.
vec3 denoised(ivec2 px, Surface receiver, vec3 p) {
#if UPSAMPLING == 1
    return load_gather(px);
#else
    const float KERNEL[5] = float[5](0.5, 1.0, 1.0, 1.0, 0.5);
    ivec2 last = size_gather() - 1;
    vec2 scale = frame.ray_scale * texel;
    vec3 sum = vec3(0.0);
    float total = 0.0;
    for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; ++x) {
            ivec2 at = clamp(px + ivec2(x, y), ivec2(0), last);
            Surface tap = load_surface(at);
            float weight = KERNEL[x + 2] * KERNEL[y + 2]
                         * agreement(receiver, p, tap, ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin));
            sum += load_gather(at) * weight;
            total += weight;
        }
    return total > 1e-4 ? sum / total : load_gather(px);
#endif
}
#endif

#ifdef HAS_COARSE
vec3 from_coarser(ivec2 px, Surface receiver, vec3 p) {
    ivec2 last = size_coarse() - 1;
#if UPSAMPLING == 1
    return load_coarse(min(px / 2, last));
#else
    vec2 scale = frame.ray_scale * (texel * 2.0);
    // The four coarse texels around the pixel: its own counts 3/4, its neighbour 1/4, along each axis.
    ivec2 own = px / 2;
    ivec2 next = own + (px & 1) * 2 - 1;
    vec3 sum = vec3(0.0), nearest = vec3(0.0);
    float total = 0.0, closest = 1e30;
    for (int i = 0; i < 4; ++i) {
        ivec2 at = clamp(ivec2((i & 1) == 0 ? own.x : next.x, (i & 2) == 0 ? own.y : next.y), ivec2(0), last);
        Surface tap = load_coarse_surface(at);
        vec3 value = load_coarse(at);
        float kernel = ((i & 1) == 0 ? 0.75 : 0.25) * ((i & 2) == 0 ? 0.75 : 0.25);
        float weight = kernel * agreement(receiver, p, tap, ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin));
        sum += value * weight;
        total += weight;
        float apart = tap.view_depth > 0.0 ? abs(tap.view_depth - receiver.view_depth) : 1e29;
        if (apart < closest) {
            closest = apart;
            nearest = value;
        }
    }
    // Nobody agrees: thin things whose surface no coarse texel kept. The neighbour nearest in depth is
    // wrong by less than black or a halo would be.
    return total > 1e-4 ? sum / total : nearest;
#endif
}
#endif

void shade(ivec2 px) {
    out_upsample = vec3(0.0);
    Surface receiver = load_surface(px);
    if (receiver.view_depth <= 0.0) return;
    vec3 p = position_from_ray(ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin),
                               receiver.view_depth);
    vec3 irradiance = vec3(0.0);
#ifdef HAS_GATHER
    irradiance += denoised(px, receiver, p);
#endif
#ifdef HAS_COARSE
    irradiance += from_coarser(px, receiver, p);
#endif
#ifdef HAS_ALBEDO
    irradiance *= load_albedo(px).a;    // the material's occlusion map: indirect light only (glTF 2.0, 3.9.3)
#endif
    out_upsample = irradiance;
}
