// Weights of cross-bilateral filters over surfaces.

// Distance to the plane at which a tap's weight is halved, relative to the view depth.
const float PLANE_TOLERANCE = 0.01;

// Windows of taps around px for what differs in each of 4x4 texels: both see each of these once, whatever the place of px, and
// neither leans to a side. last: texel of the image.

// 16 texels, + is px: 3x3, and of the columns and of the rows two away, which are the same to the pattern, now one, now the
// other, so that the mean of all is px and no diagonal is longer than the other. column, row: 0 to 3, of which 3 is the one two away.
//     . # . # .
//     # # # # .
//     . # + # #
//     . # # # #
//     # . # . .
ivec2 window_tap(ivec2 px, int column, int row, ivec2 last) {
    ivec2 place = ivec2(column, row) - 1;
    if (column == 3) place.x = row < 2 ? 2 : -2;
    if (row == 3) place.y = column == 0 || column == 2 ? 2 : -2;
    return clamp(px + place, ivec2(0), last);
}

// 5x5 texels with half weights along the rim: a quarter less of what is random, for half as many taps more. x: -2 to 2, row: 0 to 4.
ivec2 soft_window_tap(ivec2 px, int x, int row, ivec2 last) { return clamp(px + ivec2(x, row - 2), ivec2(0), last); }

float soft_window_weight(int x, int row) { return (x * x == 4 ? 0.5 : 1.0) * (row % 4 == 0 ? 0.5 : 1.0); }

// Rows of a window, 4 or 5. CPUs' compilers must keep the loop over the uniform `window`: unrolled it takes them long.
// A GPU waits for less with all of it in flight.
#ifdef GPU
const int WINDOW_ROWS = 4, SOFT_WINDOW_ROWS = 5;
#else
#define WINDOW_ROWS window
#define SOFT_WINDOW_ROWS window
#endif

// The tangent plane of a receiver.
struct Plane {
    vec3 normal;
    float offset;           // dot(normal, position)
    float nearness;         // 1 / (tolerance * view depth)
};

Plane tangent_plane(Surface receiver, vec2 ray) {
    return Plane(receiver.normal, dot(receiver.normal, position_from_ray(ray, receiver.view_depth)),
                 1.0 / (receiver.view_depth * PLANE_TOLERANCE));
}

// dot(normal, ray) over the texels of an image: linear, so that taps need neither their ray nor their position.
struct Slant {
    float at;               // at the centre of a texel
    vec2 step;              // to the next ones
};

Slant slant(vec3 normal, ivec2 px, vec2 scale) {
    vec2 ray = ray_from_pixel(vec2(px) + 0.5, scale, frame.ray_origin);
    return Slant(dot(normal, vec3(ray, -1.0)), normal.xy * scale);
}

// Distance of a tap to the receiver's tangent plane, 1 where its weight is halved. apart: texels from the one of the slant,
// which is the receiver's.
float plane_distance(Plane receiver, Slant slant, Surface tap, vec2 apart) {
    return (tap.view_depth * (slant.at + dot(slant.step, apart)) - receiver.offset) * receiver.nearness;
}

// Agreement of a tap with a receiver: of their normals, and of the tap's distance to the receiver's tangent plane.
float agreement(Plane receiver, Slant slant, Surface tap, vec2 apart) {
    float facing = max(dot(receiver.normal, tap.normal), 0.0);
    facing *= facing;
    facing *= facing;
    float off_plane = plane_distance(receiver, slant, tap, apart);
    return tap.view_depth > 0.0 ? facing * facing / (1.0 + off_plane * off_plane) : 0.0;
}

// For a tap that gathered for a coarse texel: of its footprint less than all may lie on the surface that it kept, and its middle,
// where the light was gathered, beyond the edge of that: at the foot of a wall below the floor, which then sends it nothing.
float wholeness(Surface tap) { return max(tap.whole * (0.4 + 0.6 * tap.whole), 0.01); }

// Sum of the weights below which nobody agrees: thin things whose surface no coarse texel kept. What is missing goes to
// the neighbour nearest in depth, which is wrong by less than black or a halo would be.
const float LEAST_AGREEMENT = 0.01;

// For that: distance in depth of a tap to a receiver. The background is farther than any surface.
float apart_in_depth(Surface tap, Surface receiver) {
    return tap.view_depth > 0.0 ? abs(tap.view_depth - receiver.view_depth) : 1e29;
}

// Weights of three taps that add up to LEAST_AGREEMENT at least. apart: as of `apart_in_depth`.
vec3 made_up(vec3 weights, vec3 apart) {
    float missing = max(LEAST_AGREEMENT - (weights.x + weights.y + weights.z), 0.0);
    bool first = apart.x <= min(apart.y, apart.z), second = !first && apart.y <= apart.z;
    return weights + vec3(first ? missing : 0.0, second ? missing : 0.0, first || second ? 0.0 : missing);
}
