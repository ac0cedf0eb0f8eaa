// Material and geometry of the nearest surface. One variant per set of textures that a material has.
#include "lib/material.glsl"
#include "lib/normals.glsl"
#include "lib/spaces.glsl"

in vec3 position_vs;
in vec3 normal_vs;
in vec4 tangent_vs;
in vec4 uv;
in vec4 vertex_color;
in vec3 clip_now;
in vec4 clip_previous;
flat in vec4 base_color_factor;
flat in vec4 emission_normal_scale;
flat in vec4 surface_factors;
flat in vec4 specular_layers;
flat in vec2 more_layers;
flat in int material_row;

uniform sampler2D materials;
uniform sampler2DArray base_color_map;
uniform sampler2DArray metallic_roughness_map;
uniform sampler2DArray normal_map;
uniform sampler2DArray occlusion_map;
uniform sampler2DArray emission_map;

// View depth where the ray through the pixel's centre meets the triangle's plane. GPUs move vertices to a grid of 1/256 of a
// pixel, and what is interpolated is off by as much: on surfaces that are seen at a grazing angle more than rays stand off
// them. Interpolated positions and their differences lie in the plane all the same.
float depth_at_center() {
    float depth = -position_vs.z;
    vec3 n = cross(dFdx(position_vs), dFdy(position_vs));
    vec2 ray = ray_from_pixel(gl_FragCoord.xy, frame.ray_scale, frame.ray_origin);
    float change = dot(n.xy, position_vs.xy / depth - ray) / dot(n, vec3(ray, -1.0));
    return abs(change) < 0.1 ? depth * (1.0 + change) : depth;     // neither where the plane is seen edge-on
}

void main() {
    float depth = depth_at_center();
    vec4 base = base_color_factor * vertex_color;
#ifdef BASE_COLOR_MAP
    base *= sample_map(base_color_map, specular_layers.y, 0, uv, materials, material_row);
#endif
#ifdef ALPHA_MASK
    bool hole = base.a < surface_factors.w;
#endif
    float metallic = surface_factors.x, roughness = surface_factors.y;
#ifdef METALLIC_ROUGHNESS_MAP
    vec4 metal_rough = sample_map(metallic_roughness_map, specular_layers.z, 1, uv, materials, material_row);
    metallic *= metal_rough.b;
    roughness *= metal_rough.g;
#endif
    float occlusion = 1.0;
#ifdef OCCLUSION_MAP
    occlusion = 1.0 + surface_factors.z * (sample_map(occlusion_map, more_layers.x, 3, uv, materials, material_row).r - 1.0);
#endif
    vec3 emission = emission_normal_scale.rgb;
#ifdef EMISSION_MAP
    emission *= sample_map(emission_map, more_layers.y, 4, uv, materials, material_row).rgb;
#endif

    vec3 to_camera = normalize_or(-position_vs, vec3(0.0, 0.0, 1.0));
    vec3 n = normalize_or(normal_vs, to_camera);
    float side = gl_FrontFacing ? 1.0 : -1.0;
    n *= side;
#ifdef NORMAL_MAP
    vec3 t = normalize_or(tangent_vs.xyz - n * dot(n, tangent_vs.xyz), vec3(0.0));
    vec3 b = cross(n, t) * (tangent_vs.w * side);
    vec3 mapped = sample_map(normal_map, specular_layers.w, 2, uv, materials, material_row).xyz * 2.0 - 1.0;
    mapped.xy *= emission_normal_scale.a;
    n = normalize_or(t * mapped.x + b * mapped.y + n * mapped.z, n);
#endif
    n = turned_to_camera(n, to_camera);
    // Of the triangle itself: what decides how much surface a pixel stands for, and from which side it is seen
    vec3 across = normalize_or(dFdx(position_vs), vec3(0.0)), up = normalize_or(dFdy(position_vs), vec3(0.0));
    vec3 triangle = normalize_or(cross(across, up), n);
    triangle = dot(triangle, to_camera) < 0.0 ? -triangle : triangle;

    // A fully rough dielectric is taken as Lambertian: its specular lobe, 4 % of Fresnel reflection spread
    // over the hemisphere, is not told apart from the diffuse one whose albedo already counts that light.
    float dielectric = specular_layers.x * (1.0 - smoothstep(0.8, 1.0, roughness));
    vec3 albedo = clamp(base.rgb, 0.0, 1.0) * (1.0 - metallic);
    vec3 f0 = mix(vec3(dielectric), clamp(base.rgb, 0.0, 1.0), metallic);

    out_surface = Surface(depth, n, 1.0);
    out_albedo = vec4(albedo, occlusion);
    out_specular = vec4(f0, roughness);
    out_emission = emission;
    vec2 now = clip_now.xy / clip_now.z;
    vec2 before = clip_previous.xy / max(clip_previous.w, frame.near * 1e-3);
    // Behind the old camera there is no old pixel: a displacement out of the image says so.
    bool visible_before = clip_previous.w > frame.near * 1e-3;
    vec2 displacement = visible_before ? (now - before) * 0.5 * frame.extent : vec2(4.0);
    out_motion = vec4(displacement, clip_previous.z / max(-position_vs.z, 1e-30), encode_direction16(triangle));
    store_outputs();
#ifdef ALPHA_MASK
    if (hole) discard;      // last: the lookups above take derivatives from neighbours
#endif
}
