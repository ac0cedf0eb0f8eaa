// Tables of the scene: object transforms and materials, one row of texels each (gpu/scene_buffers.py).

const int OBJECTS_PER_ROW = 128;
const int OBJECT_TEXELS = 6;

// Rows 0 to 2 of world_from_object, as they are now (offset 0) or were in the last frame (offset 3).
mat4x3 fetch_transform(sampler2D objects, int index, int offset) {
    ivec2 at = ivec2((index % OBJECTS_PER_ROW) * OBJECT_TEXELS + offset, index / OBJECTS_PER_ROW);
    vec4 r0 = texelFetch(objects, at, 0);
    vec4 r1 = texelFetch(objects, at + ivec2(1, 0), 0);
    vec4 r2 = texelFetch(objects, at + ivec2(2, 0), 0);
    return mat4x3(r0.x, r1.x, r2.x, r0.y, r1.y, r2.y, r0.z, r1.z, r2.z, r0.w, r1.w, r2.w);
}

// -1 for transforms that mirror, else 1.
float handedness(mat4x3 m) { return dot(cross(m[0], m[1]), m[2]) < 0.0 ? -1.0 : 1.0; }

// Normals go with the cofactor matrix, which exists for flattened objects too.
vec3 transform_normal(mat4x3 m, vec3 n) {
    vec3 transformed = cross(m[1], m[2]) * n.x + cross(m[2], m[0]) * n.y + cross(m[0], m[1]) * n.z;
    return transformed * handedness(m);
}
