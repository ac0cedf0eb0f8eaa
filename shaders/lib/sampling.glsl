// Sample patterns.
#include "lib/pi.glsl"

const float GOLDEN_ANGLE = 2.399963229728653;
const float GOLDEN_ANGLE_COS = -0.7373688780783197;   // cos and sin of pi (3 - sqrt 5), the Vogel spiral's step
const float GOLDEN_ANGLE_SIN = 0.6754902942615238;

// Two numbers in [0, 1) that are well spread over every aligned or shifted 4x4 block of pixels, so that
// a filter of that size sees 16 different rotations. x: rank in the 4x4 Bayer order; y: the same
// block transposed and reversed, which is as even and little correlated with x.
vec2 interleaved_4x4(ivec2 px) {
    int x = px.x & 3, y = px.y & 3;
    int a = x ^ y;
    int bayer = ((a & 1) << 3) | ((y & 1) << 2) | (a & 2) | ((y & 2) >> 1);
    int b = x ^ (3 - y);
    int other = ((x & 1) << 3) | ((b & 1) << 2) | (x & 2) | ((b & 2) >> 1);
    return (vec2(bayer, other) + 0.5) * (1.0 / 16.0);
}

vec2 direction_from_angle(float angle) { return vec2(cos(angle), sin(angle)); }

vec2 direction_from_turn(float turn) { return direction_from_angle(turn * (2.0 * PI)); }

// Rotation by the angle of another direction.
vec2 rotated(vec2 direction, vec2 turn) {
    return vec2(direction.x * turn.x - direction.y * turn.y, direction.x * turn.y + direction.y * turn.x);
}

vec2 turned(vec2 direction, float angle) { return rotated(direction, direction_from_angle(angle)); }
