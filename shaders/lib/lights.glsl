// Punctual lights with glTF's units and falloff, and their shadow maps.
// Tables: gpu/light_table.py. All positions are in world space.

const int LIGHT_DIRECTIONAL = 0;
const int LIGHT_POINT = 1;
const int LIGHT_SPOT = 2;

struct Light {
    int kind;
    vec3 position;
    vec3 direction;     // along which the light travels
    vec3 intensity;     // W sr^-1, or W m^-2 for directional lights
    float range;        // metres; 0: unlimited
    float spot_scale;   // angular falloff: clamp(cos * scale + offset)^2
    float spot_offset;
    int first_tile;     // of the shadow atlas; -1: no shadow
};

Light fetch_light(sampler2D table, int index) {
    vec4 a = texelFetch(table, ivec2(0, index), 0);
    vec4 b = texelFetch(table, ivec2(1, index), 0);
    vec4 c = texelFetch(table, ivec2(2, index), 0);
    vec4 d = texelFetch(table, ivec2(3, index), 0);
    return Light(int(a.w), a.xyz, b.xyz, c.rgb, b.w, d.x, d.y, int(c.w));
}

// Irradiance on a surface that faces the light, before shadows (KHR_lights_punctual).
// wi: unit vector towards the light.
vec3 light_irradiance(Light light, vec3 position, out vec3 wi) {
    if (light.kind == LIGHT_DIRECTIONAL) {
        wi = -light.direction;
        return light.intensity;
    }
    vec3 to_light = light.position - position;
    float squared = max(dot(to_light, to_light), 1e-12);
    wi = to_light * inversesqrt(squared);
    float falloff = 1.0 / squared;
    if (light.range > 0.0) {
        float q = squared / (light.range * light.range);
        falloff *= clamp(1.0 - q * q, 0.0, 1.0);
    }
    if (light.kind == LIGHT_SPOT) {
        float angular = clamp(dot(-wi, light.direction) * light.spot_scale + light.spot_offset, 0.0, 1.0);
        falloff *= angular * angular;
    }
    return light.intensity * falloff;
}

// Share of the light that arrives, from a tile of the shadow atlas: 16 texels through four bilinear
// comparisons. The receiver is moved off its surface along the normal by the texel's size there, which
// removes acne without the peter-panning of a depth bias.
float shadow(sampler2DShadow atlas, sampler2D tiles, Light light, vec3 position, vec3 n, vec3 wi) {
    if (light.first_tile < 0) return 1.0;
    int tile = light.first_tile;
    if (light.kind == LIGHT_POINT) {
        vec3 d = position - light.position, a = abs(d);
        if (a.x >= a.y && a.x >= a.z) tile += d.x > 0.0 ? 0 : 1;
        else if (a.y >= a.z) tile += d.y > 0.0 ? 2 : 3;
        else tile += d.z > 0.0 ? 4 : 5;
    }
    vec4 rect = texelFetch(tiles, ivec2(4, tile), 0);      // atlas uv of the tile's corner, uv size, atlas texel
    vec4 sizes = texelFetch(tiles, ivec2(5, tile), 0);     // world size of a texel: at unit distance, constant
    float texel = light.kind == LIGHT_DIRECTIONAL ? sizes.y : sizes.x * length(position - light.position);
    float n_dot_l = clamp(dot(n, wi), 0.0, 1.0);
    vec3 moved = position + n * (texel * (0.5 + 2.0 * sqrt(1.0 - n_dot_l * n_dot_l)));
    vec4 p = vec4(moved, 1.0);
    vec4 clip = vec4(dot(texelFetch(tiles, ivec2(0, tile), 0), p), dot(texelFetch(tiles, ivec2(1, tile), 0), p),
                     dot(texelFetch(tiles, ivec2(2, tile), 0), p), dot(texelFetch(tiles, ivec2(3, tile), 0), p));
    if (clip.w <= 0.0) return 1.0;
    vec3 ndc = clip.xyz / clip.w;
    if (any(greaterThan(abs(ndc.xy), vec2(1.0)))) return 1.0;
    vec2 low = rect.xy + 1.5 * rect.w, high = rect.xy + rect.z - 1.5 * rect.w;
    vec2 uv = rect.xy + (ndc.xy * 0.5 + 0.5) * rect.z;
    float depth = clamp(ndc.z * 0.5 + 0.5, 0.0, 1.0);
    float lit = 0.0;
    for (int y = -1; y <= 1; y += 2)
        for (int x = -1; x <= 1; x += 2)
            lit += textureLod(atlas, vec3(clamp(uv + vec2(x, y) * rect.w, low, high), depth), 0.0);
    return lit * 0.25;
}
