// Direct light of every light, with shadows. Writes the colour to be shown and, apart from it, the
// diffuse exitant radiance that the gather reads: what the camera sees as a highlight is not what a
// neighbouring surface receives.
#include "lib/brdf.glsl"
#include "lib/lights.glsl"

void shade(ivec2 px) {
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) {
        out_direct = vec4(frame.background, 0.0);
        out_radiance = vec3(0.0);
        return;
    }
    vec3 albedo = load_albedo(px).rgb;
    vec4 specular = load_specular(px);
    vec3 emission = load_emission(px);
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin);
    vec3 position_vs = position_from_ray(ray, surface.view_depth);
    mat3 world_rotation = mat3(frame.world_from_view);
    vec3 position = (frame.world_from_view * vec4(position_vs, 1.0)).xyz;
    vec3 n = normalize(world_rotation * surface.normal);
    vec3 wo = normalize(world_rotation * -position_vs);

    vec3 irradiance = vec3(0.0), highlight = vec3(0.0);
    for (int i = 0; i < frame.light_count; ++i) {
        Light light = fetch_light(texture_lights, i);
        vec3 wi;
        if (is_area(light)) {
            float gathered = area_irradiance(light, position, n);
            if (gathered <= 0.0) continue;
            vec3 seen = light.intensity * area_shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n);
            vec3 to_point = representative_point(light, position, reflect(-wo, n));
            wi = normalize(to_point);
            irradiance += seen * gathered;
            highlight += seen * area_highlight(specular.rgb, specular.a, n, wo, wi, gathered,
                                               area_extent(light, to_point));
            continue;
        }
        vec3 incoming = light_irradiance(light, position, wi);
        float n_dot_l = dot(n, wi);
        if (n_dot_l > 0.0 && max(max(incoming.r, incoming.g), incoming.b) > 0.0) {
            incoming *= n_dot_l * shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n, wi);
            irradiance += incoming;
            highlight += incoming * brdf_ggx(specular.rgb, specular.a, n, wo, wi);
        }
    }
    out_radiance = emission + albedo * irradiance * (1.0 / PI);
    out_direct = vec4(finite_half(out_radiance + highlight), 1.0);
}
