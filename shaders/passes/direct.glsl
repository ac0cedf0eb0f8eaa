// Direct light of every light, with shadows. Writes the colour to be shown and, apart from it, the
// diffuse exitant radiance that the gather reads: what the camera sees as a highlight is not what a
// neighbouring surface receives.
#include "lib/brdf.glsl"
#include "lib/lights.glsl"
#include "lib/taps.glsl"
#ifdef HAS_SKY
#include "lib/bilateral.glsl"
#include "lib/environment.glsl"

// Share of the environment's light that arrives and, as alpha, of its reflection, from the texel of the starting level around the
// pixel and the nearest along either axis.
vec4 sky_share(ivec2 px, Surface receiver) {
    ivec2 last = size_sky() - 1;
    Taps taps = nearest_taps((vec2(px) + 0.5) / start_texel);
    Plane plane = tangent_plane(receiver, ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin));
    Slant slanted = slant(receiver.normal, taps.at[0], frame.ray_scale * start_texel);
    vec4 shares[3];
    vec3 weights, apart;
    for (int i = 0; i < 3; ++i) {
        ivec2 at = clamp(taps.at[i], ivec2(0), last);
        Surface tap = load_start_surface(at);
        shares[i] = load_sky(at);
        weights[i] = taps.weights[i] * agreement(plane, slanted, tap, vec2(at - taps.at[0]));
        apart[i] = apart_in_depth(tap, receiver);
    }
    weights = made_up(weights, apart);
    return (shares[0] * weights.x + shares[1] * weights.y + shares[2] * weights.z) / (weights.x + weights.y + weights.z);
}

vec3 environment_background(vec2 ray) {
    vec3 world = normalize(mat3(frame.world_from_view) * vec3(ray, -1.0));
    vec2 uv = environment_uv(environment_direction(world, frame.environment_turn));
    return textureLod(texture_environment, uv, 0.0).rgb * frame.environment_strength;
}
#endif

#ifdef HAS_HISTORY
#include "lib/reproject.glsl"

// No surface sends on more than this share of what the last frame brought it. Screen-space sums can exceed what
// arrives where surfaces meet, and what grows a little with every frame grows without end.
const float MOST_SENT_ON = 0.95;
#endif

void shade(ivec2 px) {
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) {
        vec3 backdrop = frame.background;
#ifdef HAS_SKY
        backdrop = environment_background(ray_from_pixel(vec2(px) + 0.5, frame.ray_scale, frame.ray_origin));
#endif
        out_direct = backdrop;
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

    // Shadow maps hold triangles: neither smoothed nor mapped normals tell where their planes run
    vec3 triangle = normalize(world_rotation * decode_direction16(load_motion(px).w));
#ifdef HAS_TRACED
    uint traced = load_traced(px);
#endif
    vec3 irradiance = vec3(0.0), highlight = vec3(0.0);
    int i = 0;
    if (punctual_lights > 0) do {
        Light light = fetch_light(texture_lights, i);
        vec3 wi;
        vec3 incoming = light_irradiance(light, position, wi);
        float n_dot_l = dot(n, wi);
        if (lights_front(incoming, n_dot_l)) {
            float lit = 0.0;
#ifdef HAS_TRACED
            uint answer = i < TRACED_LAMPS ? (traced >> uint(2 * i)) & 3u : 0u;
            if (answer == LAMP_SEEN) lit = 1.0;
            else if (answer == 0u)
#endif
            lit = shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n, triangle, wi);
            incoming *= n_dot_l * lit;
            irradiance += incoming;
            highlight += incoming * brdf_ggx(specular.rgb, specular.a, n, wo, wi);
        }
    } while (++i < punctual_lights);
#ifdef AREA_LIGHTS
    i = punctual_lights;
    if (i < frame.light_count) do {
        AreaLight light = fetch_area_light(texture_lights, i);
        float gathered = area_irradiance(light, position, n);
        if (gathered <= 0.0) continue;
        vec3 seen = light.radiance * area_shadow(texture_shadow_atlas, texture_shadow_tiles, light, position, n, triangle);
        vec3 to_point = representative_point(light, position, reflect(-wo, n));
        irradiance += seen * gathered;
        highlight += seen * area_highlight(specular.rgb, specular.a, n, wo, normalize(to_point), gathered,
                                           area_extent(light, to_point));
    } while (++i < frame.light_count);
#endif
#ifdef HAS_SKY
    vec3 normal = environment_direction(n, frame.environment_turn);
    vec3 mirror = environment_direction(reflect(-wo, n), frame.environment_turn);
    // Both the image and the material's occlusion map may know of the same hollow: it darkens once, by the stronger of them
    vec4 shares = sky_share(px, surface);
    float map = load_albedo(px).a;
    vec3 open = min(shares.rgb, vec3(map));
    irradiance += environment_irradiance(texture_environment_irradiance, normal) * open * frame.environment_strength;
    float n_dot_v = max(dot(n, wo), 0.0);
    float open_ahead = min(shares.a, specular_occlusion(n_dot_v, map, specular.a));
    highlight += environment_specular(texture_environment_specular, mirror, specular.a)
               * environment_brdf(specular.rgb, specular.a, n_dot_v) * (open_ahead * frame.environment_strength);
#endif
    out_radiance = emission + albedo * irradiance * (1.0 / PI);
    out_direct = out_radiance + highlight;
#ifdef HAS_HISTORY
    vec4 history;
    if (frame.history_frames > 0 && find_history(find_previous(px, surface), vec3(1.0), history))
        out_radiance += min(albedo, MOST_SENT_ON) * history.rgb * (1.0 / PI);
#endif
}
