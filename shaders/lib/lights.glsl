// Lights and their shadow maps: punctual ones with glTF's units and falloff, and areas of even radiance.
// Tables: gpu/light_table.py, punctual lights first. All positions are in world space. AREA_RECTANGLE, AREA_DISC and
// AREA_SPHERE are defined where there are such lights: code that does not run costs, too.
#include "lib/float_table.glsl"
// Here already: a file counts as included even where an #if leaves its lines out
#include "lib/pi.glsl"
#if defined(AREA_RECTANGLE) || defined(AREA_DISC) || defined(AREA_SPHERE)
#define AREA_LIGHTS
#include "lib/area_lights.glsl"
#endif

const int LIGHT_DIRECTIONAL = 0;
const int LIGHT_POINT = 1;
const int LIGHT_SPOT = 2;
const int LIGHT_RECTANGLE = 3;
const int LIGHT_DISC = 4;
const int LIGHT_SPHERE = 5;

// What passes/shadow_rays.glsl says of each of the first lamps.
const int TRACED_LAMPS = 16;
const uint LAMP_SEEN = 1u;
const uint LAMP_HIDDEN = 2u;

struct Light {
    int kind;
    vec3 position;
    vec3 direction;     // along which the light travels
    vec3 intensity;     // W sr^-1, or W m^-2 for directional lights, or W m^-2 sr^-1 for areas
    float range;        // metres; 0: unlimited
    float spot_scale;   // angular falloff: clamp(cos * scale + offset)^2
    float spot_offset;
    int first_tile;     // of the shadow atlas; -1: no shadow
};

Light fetch_light(FLOAT_TABLE table, int index) {
    vec4 a = FLOAT_TEXEL(table, ivec2(0, index));
    vec4 b = FLOAT_TEXEL(table, ivec2(1, index));
    vec4 c = FLOAT_TEXEL(table, ivec2(2, index));
    vec4 d = FLOAT_TEXEL(table, ivec2(3, index));
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

// Whether light falls onto a surface's front. n_dot_l: dot(n, wi).
bool lights_front(vec3 incoming, float n_dot_l) {
    return n_dot_l > 0.0 && max(max(incoming.r, incoming.g), incoming.b) > 0.0;
}

// A tile of the atlas: its view, and its place, in texels.
struct Tile {
    mat4 clip_from_world;
    vec2 corner;
    float side;
};

Tile fetch_tile(FLOAT_TABLE tiles, int tile) {
    vec4 place = FLOAT_TEXEL(tiles, ivec2(4, tile));
    return Tile(transpose(mat4(FLOAT_TEXEL(tiles, ivec2(0, tile)), FLOAT_TEXEL(tiles, ivec2(1, tile)),
                               FLOAT_TEXEL(tiles, ivec2(2, tile)), FLOAT_TEXEL(tiles, ivec2(3, tile)))),
                place.xy, place.z);
}

vec3 tile_ndc(Tile tile, vec3 position) {
    vec4 clip = tile.clip_from_world * vec4(position, 1.0);
    return clip.w > 0.0 ? clip.xyz / clip.w : vec3(2.0);    // behind is outside
}

// Four bilinear comparisons, up to `spread` texels to each side, on a turned square, so that either axis has four places
// instead of two: 0 to 1. slope: change of depth from texel to texel.
float filtered_shadow(sampler2DShadow atlas, Tile tile, vec3 ndc, float spread, vec2 slope) {
    if (any(greaterThan(abs(ndc.xy), vec2(1.0)))) return 1.0;
    vec2 texel = 1.0 / vec2(textureSize(atlas, 0));
    vec2 low = tile.corner + 1.5, high = tile.corner + (tile.side - 1.5);
    vec2 place = tile.corner + (ndc.xy * 0.5 + 0.5) * tile.side;
    vec2 apart = vec2(1.0, 1.0 / 3.0) * spread;
    float lit = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 at = clamp(place + apart, low, high);
        // What is farther from the light than the receiver cannot hide it. Where its plane goes on behind a corner, the depth
        // there would be that of what lies behind the wall, which is lit
        float depth = clamp(ndc.z * 0.5 + 0.5 + min(dot(slope, at - place), 0.0), 0.0, 1.0);
        lit += textureLod(atlas, vec3(at * texel, depth), 0.0);
        apart = vec2(-apart.y, apart.x);
    }
    return lit * 0.25;
}

float sine_of(float cosine) { return sqrt(max(1.0 - cosine * cosine, 0.0)); }

// Change of depth with texels of the atlas over the plane through a point: planes stay planes in normalised device coordinates.
// False where the light sees the plane edge-on: there is no such slope.
bool plane_slope(Tile tile, vec3 position, vec3 n, float texel, out vec2 slope) {
    vec3 a = cross(n, abs(n.x) < 0.9 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 0.0, 1.0)) * texel, b = cross(n, a);
    vec3 here = tile_ndc(tile, position);
    vec3 first = tile_ndc(tile, position + a) - here, second = tile_ndc(tile, position + b) - here;
    float area = first.x * second.y - first.y * second.x;
    slope = vec2(0.0);
    if (abs(area) < 0.05 * length(first) * length(second)) return false;
    // Depth is half of ndc, texels half of ndc times the tile's side
    slope = vec2(first.z * second.y - second.z * first.y, second.z * first.x - first.z * second.x) / (area * tile.side);
    return true;
}

// Share of a punctual light that arrives: 16 texels of one tile. triangle: the unit normal of the receiver's own triangle,
// which n, smoothed and mapped, is not. Each comparison has the depth of that plane there, so that moving the receiver off
// its surface by a part of a texel is enough against acne: at grazing light an offset moves the shadow's edge by many times
// as much.
float shadow(sampler2DShadow atlas, FLOAT_TABLE tiles, Light light, vec3 position, vec3 n, vec3 triangle, vec3 wi) {
    if (light.first_tile < 0) return 1.0;
    int tile = light.first_tile;
    if (light.kind == LIGHT_POINT) {
        vec3 d = position - light.position, a = abs(d);
        if (a.x >= a.y && a.x >= a.z) tile += d.x > 0.0 ? 0 : 1;
        else if (a.y >= a.z) tile += d.y > 0.0 ? 2 : 3;
        else tile += d.z > 0.0 ? 4 : 5;
    }
    vec4 sizes = FLOAT_TEXEL(tiles, ivec2(5, tile));     // world size of a texel: at unit distance, constant
    float texel = light.kind == LIGHT_DIRECTIONAL ? sizes.y : sizes.x * length(position - light.position);
    Tile view = fetch_tile(tiles, tile);
    vec2 slope;
    bool followed = plane_slope(view, position, triangle, texel, slope);
    float sine = sine_of(clamp(dot(n, wi), 0.0, 1.0));
    vec3 moved = position + n * (texel * (followed ? 0.25 + 0.25 * sine : 0.5 + 2.0 * sine));
    return filtered_shadow(atlas, view, tile_ndc(view, moved), 1.0, slope);
}

#ifdef AREA_LIGHTS
struct AreaLight {
    int kind;
    vec3 position;
    vec3 direction;     // of the side that emits
    vec3 u;             // unit vector along a rectangle's width
    vec2 half_size;     // of a rectangle; x: radius of a disc or sphere
    vec3 radiance;
    int first_tile;     // of the shadow atlas; -1: no shadow
    int shadow_points;
};

AreaLight fetch_area_light(FLOAT_TABLE table, int index) {
    vec4 a = FLOAT_TEXEL(table, ivec2(0, index));
    vec4 b = FLOAT_TEXEL(table, ivec2(1, index));
    vec4 c = FLOAT_TEXEL(table, ivec2(2, index));
    vec4 d = FLOAT_TEXEL(table, ivec2(3, index));
    vec4 e = FLOAT_TEXEL(table, ivec2(4, index));
    return AreaLight(int(a.w), a.xyz, b.xyz, e.xyz, d.zw, c.rgb, int(c.w), int(e.w));
}

// E / L of an area, before shadows.
float area_irradiance(AreaLight light, vec3 position, vec3 n) {
    vec3 center = light.position - position;
#ifdef AREA_SPHERE
    if (light.kind == LIGHT_SPHERE) return sphere_irradiance(center, light.half_size.x, n);
#endif
#ifdef AREA_DISC
    if (light.kind == LIGHT_DISC) return disc_irradiance(center, light.half_size.x, light.u, light.direction, n);
#endif
#ifdef AREA_RECTANGLE
    vec3 v = cross(light.direction, light.u);
    return rectangle_irradiance(center, light.u * light.half_size.x, v * light.half_size.y, light.direction, n);
#else
    return 0.0;
#endif
}

float area_size(AreaLight light) {
    float r = light.half_size.x;
    if (light.kind == LIGHT_RECTANGLE) return 4.0 * r * light.half_size.y;
    return (light.kind == LIGHT_DISC ? 1.0 : 4.0) * PI * r * r;
}

const float LEAST_FACING = 0.1;
const int AREA_TILES = 3;   // of each point: they cover the side to which it emits

// Share of an area's light that arrives: the mean over its points, each with the form factor of its part of the area.
float area_shadow(sampler2DShadow atlas, FLOAT_TABLE tiles, AreaLight light, vec3 position, vec3 n, vec3 triangle) {
    if (light.first_tile < 0) return 1.0;
    float part = area_size(light) / (PI * float(light.shadow_points));
    float lit = 0.0, total = 0.0;
    int i = 0;
    do {
        int tile = light.first_tile + AREA_TILES * i;
        vec4 point = FLOAT_TEXEL(tiles, ivec2(6, tile));     // w: world distance between such points
        vec3 to_point = point.xyz - position;
        vec3 outward = light.kind == LIGHT_SPHERE ? point.xyz - light.position : light.direction;
        float emitted = -dot(to_point, outward), received = dot(to_point, n);
        if (emitted <= 0.0 || received <= 0.0) continue;
        float squared = dot(to_point, to_point);
        float weight = emitted * received / (squared * (squared + part));
        // The tile whose axis goes most along the way: the three are at right angles, tilted alike off the outward normal
        vec4 there = vec4(position, 1.0);
        vec4 axis = FLOAT_TEXEL(tiles, ivec2(3, tile));
        float along = dot(axis, there);
        int best = tile;
        for (int k = 1; k < AREA_TILES; ++k) {
            vec4 other = FLOAT_TEXEL(tiles, ivec2(3, tile + k));
            float way = dot(other, there);
            if (way > along) {
                along = way;
                axis = other;
                best = tile + k;
            }
        }
        float texel = FLOAT_TEXEL(tiles, ivec2(5, tile)).x * max(along, 0.0);
        // Neighbouring points' shadows must overlap, or their edges are seen one by one
        float spread = clamp(0.5 * point.w / max(texel, 1e-30), 1.0, 3.0);
        // Off its surface by a part of a texel, and each comparison with the depth of the receiver's own plane there: a
        // wide filter would otherwise need an offset that moves the shadow
        Tile view = fetch_tile(tiles, best);
        vec3 moved = position + n * (texel * (0.25 + sine_of(dot(axis.xyz, n))));
        vec2 slope;
        // A triangle that hardly faces the point, if at all, would hide itself, where the smooth normal faces it
        bool faces = dot(to_point, triangle) > LEAST_FACING * sqrt(squared);
        plane_slope(view, moved, faces ? triangle : n, texel, slope);
        lit += weight * filtered_shadow(atlas, view, tile_ndc(view, moved), spread, slope);
        total += weight;
    } while (++i < light.shadow_points);
    return total > 0.0 ? lit / total : 1.0;
}

// The point of an area that a mirror at `position` would show, or the nearest to it (Karis 2013, "representative
// point"). reflected: unit vector.
vec3 representative_point(AreaLight light, vec3 position, vec3 reflected) {
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
float area_extent(AreaLight light, vec3 to_point) {
    float squared = dot(to_point, to_point);
    if (light.kind == LIGHT_SPHERE) return light.half_size.x * light.half_size.x / squared;
    float facing = max(-dot(light.direction, to_point), 0.0) * inversesqrt(squared);
    return area_size(light) * facing / (PI * squared);
}
#endif
