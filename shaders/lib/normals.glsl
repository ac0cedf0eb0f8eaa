// Unit normals of what the camera sees.

// A zero vector becomes the fallback instead of NaN.
vec3 normalize_or(vec3 v, vec3 fallback) {
    float squared = dot(v, v);
    return squared > 1e-30 ? v * inversesqrt(squared) : fallback;
}

// What is seen faces the camera: interpolated and mapped normals can point away from it near silhouettes, where the
// area that a pixel stands for would be negative.
vec3 turned_to_camera(vec3 n, vec3 to_camera) {
    const float LEAST_FACING = 0.01;
    float facing = dot(n, to_camera);
    return facing < LEAST_FACING ? normalize_or(n + to_camera * (LEAST_FACING - facing), to_camera) : n;
}
