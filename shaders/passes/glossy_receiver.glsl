// How a texel reflects. Included by the passes that gather reflections. Needs the reads `image_surface` and `specular`, both of
// level 0, and the uniform `texel`.
#include "lib/on_plane.glsl"
#include "lib/phong.glsl"

struct Mirror {
    vec3 direction;     // of the ideal reflection, view space
    float exponent;
    float n_dot_r;
    float scale;        // 1 / phong_albedo
};

// The surface that a texel kept: the mean of four of its pixels, as far as they lie on it. roughness: negative where nothing reflects.
struct Kept {
    float roughness;
    vec2 center;        // in texels: of the part that has it
};

Kept what_is_kept(ivec2 px, Surface surface, vec3 position) {
    ivec2 last = size_image_surface() - 1;
    float sum = 0.0, total = 0.0, counted = 0.0;
    vec2 places = vec2(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 corner = vec2(px) + (vec2(i & 1, i >> 1) * 0.5 + 0.25);
        ivec2 at = min(ivec2(corner * texel), last);
        Surface fine = load_image_surface(at);
        vec3 there = position_from_ray(ray_from_pixel(vec2(at) + 0.5, frame.ray_scale, frame.ray_origin),
                                       fine.view_depth);
        float off_plane = abs(dot(surface.normal, there - position));
        vec4 specular = load_specular(at);
        float weight = max(max(specular.r, specular.g), specular.b) * max(dot(fine.normal, surface.normal), 0.0);
        if (fine.view_depth <= 0.0 || off_plane > 0.02 * surface.view_depth) weight = 0.0;
        sum += specular.a * weight;
        total += weight;
        // Narrower than the weight: at the foot of a wall the floor is not far from the wall's plane
        if (weight > 0.0 && off_plane < 0.003 * surface.view_depth) {
            places += corner;
            counted += 1.0;
        }
    }
    return Kept(total > 1e-4 ? sum / total : -1.0, counted > 0.0 ? places / counted : vec2(px) + 0.5);
}

// Where the texel reflects from: its own middle may lie beyond the edge of its surface, from where nothing is mirrored as it should
// be. Where the plane is seen nearly edge-on, a part of a texel is a long way, and the middle must do: `kept` has it then.
vec3 kept_position(ivec2 px, Surface surface, vec3 position, inout Kept kept) {
    OnPlane there = on_plane(surface, px, kept.center, frame.ray_scale * texel);
    bool is_near = abs(there.depth - surface.view_depth) < 0.03 * surface.view_depth;
    if (!is_near) kept.center = vec2(px) + 0.5;
    return is_near ? position_from_ray(there.ray, there.depth) : position;
}

Mirror mirror_of(float roughness, vec3 position, vec3 normal) {
    vec3 r = reflect(normalize(position), normal);
    float exponent = phong_exponent(roughness), n_dot_r = dot(normal, r);
    return Mirror(r, exponent, n_dot_r, 1.0 / phong_albedo(exponent, n_dot_r));
}
