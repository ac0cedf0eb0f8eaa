// Direct light on one surfel of the scene, as long as the image does not show it. ENVIRONMENT: there is one.
#include "lib/unseen.glsl"

void shade(ivec2 px) {
    out_unseen_radiance = vec4(0.0);
    vec4 place = texelFetch(texture_surfel_position, px, 0);
    if (place.w <= 0.0) return;
    vec3 position = place.xyz, n = texelFetch(texture_surfel_normal, px, 0).xyz;
    vec3 position_vs = (frame.view_from_world * vec4(position, 1.0)).xyz;
    if (!sends_unseen(position_vs, mat3(frame.view_from_world) * n)) return;
    uint random = hash(uint(px.x + (px.y << 12)) ^ hash(uint(random_seed)));
    vec3 radiance = lambert_radiance(random, position, n, texelFetch(texture_surfel_albedo, px, 0).rgb,
                                  texelFetch(texture_surfel_emission, px, 0).rgb);
    out_unseen_radiance = vec4(radiance, dot(radiance, vec3(1.0 / 3.0)) * place.w);
}
