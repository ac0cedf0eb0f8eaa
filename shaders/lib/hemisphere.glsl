#include "lib/pi.glsl"

// A unit vector about n with a density of cosine over pi, from two numbers in [0, 1).
vec3 cosine_direction(vec3 n, float u, float v) {
    float turn = 2.0 * PI * u, height = 1.0 - 2.0 * v, across = sqrt(max(1.0 - height * height, 0.0));
    // A point on the unit sphere that touches the surface from above
    vec3 d = n + vec3(across * cos(turn), across * sin(turn), height);
    return dot(d, d) > 1e-12 ? normalize(d) : n;
}
