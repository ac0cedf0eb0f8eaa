// Vertices of the scene to clip space, now and in the last frame.
#include "lib/scene.glsl"

in vec3 position;
in vec3 normal;
in vec4 tangent;
in vec4 texcoords;      // UV set 0 in xy, set 1 in zw
in vec4 color;
in ivec2 object_material;

uniform sampler2D objects;
uniform sampler2D materials;

out vec3 position_vs;
out vec3 normal_vs;
out vec4 tangent_vs;
out vec4 uv;
out vec4 vertex_color;
out vec3 clip_now;      // x, y, w
out vec4 clip_previous; // x, y, w of the last frame; z: view depth there
flat out vec4 base_color_factor;
flat out vec4 emission_normal_scale;    // rgb emission, a normal scale
flat out vec4 surface_factors;          // metallic, roughness, occlusion strength, alpha cutoff
flat out vec4 specular_layers;          // dielectric F0, layers of base color, metallic-roughness, normal
flat out vec2 more_layers;              // layers of occlusion, emission
flat out int material_row;

void main() {
    mat4x3 world_from_object = fetch_transform(objects, object_material.x, 0);
    mat4x3 world_from_object_previous = fetch_transform(objects, object_material.x, 3);
    mat3 view_rotation = mat3(frame.view_from_world);
    position_vs = (frame.view_from_world * vec4(world_from_object * vec4(position, 1.0), 1.0)).xyz;
    normal_vs = view_rotation * transform_normal(world_from_object, normal);
    tangent_vs = vec4(view_rotation * (mat3(world_from_object) * tangent.xyz),
                      tangent.w * handedness(world_from_object));
    gl_Position = frame.clip_from_view * vec4(position_vs, 1.0);
    vec4 before_vs = frame.previous_view_from_world * vec4(world_from_object_previous * vec4(position, 1.0), 1.0);
    vec4 before = frame.previous_clip_from_view * before_vs;
    clip_now = gl_Position.xyw;
    clip_previous = vec4(before.xy, -before_vs.z, before.w);
    uv = texcoords;
    vertex_color = color;
    int row = object_material.y;
    material_row = row;
    base_color_factor = texelFetch(materials, ivec2(0, row), 0);
    emission_normal_scale = texelFetch(materials, ivec2(1, row), 0);
    surface_factors = texelFetch(materials, ivec2(2, row), 0);
    specular_layers = texelFetch(materials, ivec2(3, row), 0);
    more_layers = texelFetch(materials, ivec2(4, row), 0).xy;
}
