// Lights and their shadow maps: punctual ones with glTF's units and falloff, and areas of even radiance.
// Tables: gpu/light_table.py. All positions are in world space.
#include "lib/area_lights.glsl"

const int LIGHT_DIRECTIONAL = 0;
const int LIGHT_POINT = 1;
const int LIGHT_SPOT = 2;
const int LIGHT_RECTANGLE = 3;
const int LIGHT_DISC = 4;
const int LIGHT_SPHERE = 5;

struct Light {
    int kind;
    vec3 position;
    vec3 direction;     // along which the light travels
    vec3 intensity;     // W sr^-1, or W m^-2 for directional lights, or W m^-2 sr^-1 for areas
    float range;        // metres; 0: unlimited
    float spot_scale;   // angular falloff: clamp(cos * scale + offset)^2
    float spot_offset;
    int first_tile;     // of the shadow atlas; -1: no shadow
    int shadow_points;  // on an area
    vec2 half_size;     // of a rectangle; x: radius of a disc or sphere
    vec3 u;             // unit vector along a rectangle's width
};

Light fetch_light(sampler2D table, int index) {
    vec4 a = texelFetch(table, ivec2(0, index), 0);
    vec4 b = texelFetch(table, ivec2(1, index), 0);
    vec4 c = texelFetch(table, ivec2(2, index), 0);
    vec4 d = texelFetch(table, ivec2(3, index), 0);
    vec4 e = texelFetch(table, ivec2(4, index), 0);
    return Light(int(a.w), a.xyz, b.xyz, c.rgb, b.w, d.x, d.y, int(c.w), int(e.w), d.zw, e.xyz);
}

bool is_area(Light light) { return light.kind >= LIGHT_RECTANGLE; }

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

// Position in a tile's view, and whether the tile shows it.
struct TilePoint {
    vec2 uv;            // in the atlas
    float depth;
    bool inside;
};

TilePoint project_to_tile(sampler2D tiles, int tile, vec4 rect, vec3 position) {
    vec4 p = vec4(position, 1.0);
    vec4 clip = vec4(dot(texelFetch(tiles, ivec2(0, tile), 0), p), dot(texelFetch(tiles, ivec2(1, tile), 0), p),
                     dot(texelFetch(tiles, ivec2(2, tile), 0), p), dot(texelFetch(tiles, ivec2(3, tile), 0), p));
    vec3 ndc = clip.xyz / max(clip.w, 1e-30);
    return TilePoint(rect.xy + (ndc.xy * 0.5 + 0.5) * rect.z, clamp(ndc.z * 0.5 + 0.5, 0.0, 1.0),
                     clip.w > 0.0 && all(lessThanEqual(abs(ndc.xy), vec2(1.0))));
}

// Four bilinear comparisons, `spread` texels to each side.
float filtered_shadow(sampler2DShadow atlas, vec4 rect, TilePoint point, float spread) {
    vec2 low = rect.xy + 1.5 * rect.w, high = rect.xy + rect.z - 1.5 * rect.w;
    float lit = 0.0;
    for (int y = -1; y <= 1; y += 2)
        for (int x = -1; x <= 1; x += 2)
            lit += textureLod(atlas, vec3(clamp(point.uv + vec2(x, y) * (spread * rect.w), low, high), point.depth), 0.0);
    return lit * 0.25;
}

// What arrives at `position` from one view, 0 to 1. The receiver is moved off its surface along the normal by the
// texel's size there, which removes acne without the peter-panning of a depth bias.
// slope: cosine between the normal and the direction along which the texel's size is `texel`, at the receiver, metres.
float tile_shadow(sampler2DShadow atlas, sampler2D tiles, int tile, vec3 position, vec3 n, float slope, float texel,
                  float spread) {
    vec4 rect = texelFetch(tiles, ivec2(4, tile), 0);      // atlas uv of the tile's corner, uv size, atlas texel
    float sine = sqrt(max(1.0 - slope * slope, 0.0));
    vec3 moved = position + n * (texel * (0.5 + (1.0 + spread) * sine));
    TilePoint point = project_to_tile(tiles, tile, rect, moved);
    return point.inside ? filtered_shadow(atlas, rect, point, spread) : 1.0;
}

// Share of a punctual light that arrives: 16 texels of one tile.
float shadow(sampler2DShadow atlas, sampler2D tiles, Light light, vec3 position, vec3 n, vec3 wi) {
    if (light.first_tile < 0) return 1.0;
    int tile = light.first_tile;
    if (light.kind == LIGHT_POINT) {
        vec3 d = position - light.position, a = abs(d);
        if (a.x >= a.y && a.x >= a.z) tile += d.x > 0.0 ? 0 : 1;
        else if (a.y >= a.z) tile += d.y > 0.0 ? 2 : 3;
        else tile += d.z > 0.0 ? 4 : 5;
    }
    vec4 sizes = texelFetch(tiles, ivec2(5, tile), 0);     // world size of a texel: at unit distance, constant
    float texel = light.kind == LIGHT_DIRECTIONAL ? sizes.y : sizes.x * length(position - light.position);
    return tile_shadow(atlas, tiles, tile, position, n, clamp(dot(n, wi), 0.0, 1.0), texel, 1.0);
}

// E / L of an area, before shadows.
float area_irradiance(Light light, vec3 position, vec3 n) {
    vec3 center = light.position - position;
    if (light.kind == LIGHT_SPHERE) return sphere_irradiance(center, light.half_size.x, n);
    if (light.kind == LIGHT_DISC) return disc_irradiance(center, light.half_size.x, light.u, light.direction, n);
    vec3 v = cross(light.direction, light.u);
    return rectangle_irradiance(center, light.u * light.half_size.x, v * light.half_size.y, light.direction, n);
}

float area_size(Light light) {
    float r = light.half_size.x;
    if (light.kind == LIGHT_RECTANGLE) return 4.0 * r * light.half_size.y;
    return (light.kind == LIGHT_DISC ? 1.0 : 4.0) * AREA_PI * r * r;
}

const int AREA_TILES = 3;   // of each point: they cover the side to which it emits

// Share of an area's light that arrives: the mean over its points, each with the form factor of its part of the area.
float area_shadow(sampler2DShadow atlas, sampler2D tiles, Light light, vec3 position, vec3 n) {
    if (light.first_tile < 0) return 1.0;
    float part = area_size(light) / (AREA_PI * float(light.shadow_points));
    float lit = 0.0, total = 0.0;
    for (int i = 0; i < light.shadow_points; ++i) {
        int tile = light.first_tile + AREA_TILES * i;
        vec4 point = texelFetch(tiles, ivec2(6, tile), 0);     // w: world distance between such points
        vec3 to_point = point.xyz - position;
        vec3 outward = light.kind == LIGHT_SPHERE ? point.xyz - light.position : light.direction;
        float emitted = -dot(to_point, outward), received = dot(to_point, n);
        if (emitted <= 0.0 || received <= 0.0) continue;
        float squared = dot(to_point, to_point);
        float weight = emitted * received / (squared * (squared + part));
        // The tile whose axis goes most along the way: the three are at right angles, tilted alike off the outward normal
        vec4 there = vec4(position, 1.0);
        vec4 axis = texelFetch(tiles, ivec2(3, tile), 0);
        float along = dot(axis, there);
        int best = tile;
        for (int k = 1; k < AREA_TILES; ++k) {
            vec4 other = texelFetch(tiles, ivec2(3, tile + k), 0);
            float way = dot(other, there);
            if (way > along) {
                along = way;
                axis = other;
                best = tile + k;
            }
        }
        float texel = texelFetch(tiles, ivec2(5, tile), 0).x * max(along, 0.0);
        // Neighbouring points' shadows must overlap, or their edges are seen one by one
        float spread = clamp(0.5 * point.w / max(texel, 1e-30), 1.0, 3.0);
        lit += weight * tile_shadow(atlas, tiles, best, position, n, dot(axis.xyz, n), texel, spread);
        total += weight;
    }
    return total > 0.0 ? lit / total : 1.0;
}

// The point of an area that a mirror at `position` would show, or the nearest to it (Karis 2013, "representative
// point"). reflected: unit vector.
vec3 representative_point(Light light, vec3 position, vec3 reflected) {
    vec3 center = light.position - position;
    if (light.kind == LIGHT_SPHERE) {
        vec3 nearest = dot(center, reflected) * reflected - center;
        return center + nearest * min(light.half_size.x * inversesqrt(max(dot(nearest, nearest), 1e-20)), 1.0);
    }
    float slope = dot(reflected, light.direction);
    // A ray that runs away from the plane is taken to meet it far out, on the side to which it goes
    float way = slope < -1e-4 ? dot(center, light.direction) / slope : 1e4 * length(center);
    vec3 offset = reflected * way - center;
    vec3 v = cross(light.direction, light.u);
    vec2 at = vec2(dot(offset, light.u), dot(offset, v));
    if (light.kind == LIGHT_DISC) at *= min(light.half_size.x / max(length(at), 1e-20), 1.0);
    else at = clamp(at, -light.half_size, light.half_size);
    return center + light.u * at.x + v * at.y;
}

// Part of the sphere of directions that an area fills, roughly, over pi: its sin^2 of the half angle if it were a sphere.
float area_extent(Light light, vec3 to_point) {
    float squared = dot(to_point, to_point);
    if (light.kind == LIGHT_SPHERE) return light.half_size.x * light.half_size.x / squared;
    float facing = max(-dot(light.direction, to_point), 0.0) * inversesqrt(squared);
    return area_size(light) * facing / (AREA_PI * squared);
}
