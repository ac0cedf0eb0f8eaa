// Lookups in an environment map (scene/environment.py): the middle column is +Z, the columns to the right of it turn towards
// -X, the top row is +Y.
#include "lib/pi.glsl"

// A world direction as the map knows it. turn: cosine and sine of the map's rotation about +Y.
vec3 environment_direction(vec3 world, vec2 turn) {
    return vec3(turn.x * world.x - turn.y * world.z, world.y, turn.y * world.x + turn.x * world.z);
}

vec2 environment_uv(vec3 d) {
    // At the poles the turn means nothing, and the arctangent of nothing is undefined
    float turn = abs(d.x) + abs(d.z) > 1e-12 ? atan(d.x, -d.z) : 0.0;
    return vec2(turn / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
}

// The irradiance map has its texels on whole columns, and on both poles.
vec3 environment_irradiance(sampler2D map, vec3 n) {
    vec2 size = vec2(textureSize(map, 0)), uv = environment_uv(n);
    return textureLod(map, vec2(uv.x + 0.5 / size.x, (uv.y * (size.y - 1.0) + 0.5) / size.y), 0.0).rgb;
}

// Mean radiance over the GGX lobe of a roughness around a direction.
vec3 environment_specular(sampler2D map, vec3 d, float roughness) {
    const float LEVELS = 5.0;       // roughness 0, 0.2, ... 1
    return textureLod(map, environment_uv(d), roughness * LEVELS).rgb;
}
