// Slices of the directions around a point that is seen: a slice is a half turn of the plane through the view ray, and all of
// it lies on one line of the screen (Jimenez et al. 2016). Needs `Surface load_level(ivec2 px, int coarser)`, the surface so many
// levels above the one at hand, the read `surface` and the uniform `texel`.
#include "lib/sampling.glsl"

// What is seen at a place in texels, exactly there: the texel's surface is followed along its plane, or else rounding would
// leave the slice, and a plane seen at a grazing angle would hide itself.
struct Seen {
    vec3 position, normal;
    float view_depth;   // 0 is background
};

Seen seen_at(vec2 at, int coarser) {
    ivec2 px = ivec2(at) >> coarser;
    Surface met = load_level(px, coarser);
    vec2 scale = frame.ray_scale * texel;
    vec3 middle = vec3(ray_from_pixel((vec2(px) + 0.5) * float(1 << coarser), scale, frame.ray_origin), -1.0);
    vec3 ray = vec3(ray_from_pixel(at, scale, frame.ray_origin), -1.0);
    float ahead = min(dot(met.normal, ray), -1e-4);
    float view_depth = met.view_depth * clamp(dot(met.normal, middle) / ahead, 0.5, 2.0);
    return Seen(ray * view_depth, met.normal, view_depth);
}

// A slice through a point. to_camera and along are unit vectors at right angles in its plane; `along` is where the
// walk goes. turn: angle of the surface's normal in the plane, from to_camera towards `along`. The other two span the plane
// that `along` turns in.
struct Slice {
    vec3 to_camera, along;
    float turn;
    vec3 across, upward;
};

Slice first_slice(vec3 p) {
    vec3 to_camera = normalize(-p);
    vec3 across = normalize(cross(to_camera, abs(to_camera.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0)));
    return Slice(to_camera, across, 0.0, across, cross(across, to_camera));
}

// Angle of a direction of any length in the slice from to_camera, to either side.
float angle_from_camera(Slice slice, vec3 v) {
    return acos(clamp(dot(v, slice.to_camera) * inversesqrt(max(dot(v, v), 1e-30)), -1.0, 1.0));
}

// Turns the slice, by a share of a whole turn from the first one. Returns the length of the normal within it.
float turn_slice(inout Slice slice, float share, vec3 normal) {
    vec2 turned = direction_from_turn(share);
    slice.along = slice.across * turned.x + slice.upward * turned.y;
    vec2 within = vec2(dot(normal, slice.to_camera), dot(normal, slice.along));
    slice.turn = atan(within.y, within.x);
    return length(within);
}

// The line on the screen to one side (1 or -1) of the point, which is seen at `center`, in texels: its direction, and how far
// the edge of the image is. False where the point would not move on the screen.
bool find_line(float side, Slice slice, vec3 p, vec2 center, out vec2 direction, out float reach) {
    vec3 to = slice.along * side;
    vec2 moved = (to.xy * -p.z + p.xy * to.z) / frame.ray_scale;
    float speed = length(moved);
    direction = moved / max(speed, 1e-20);
    vec2 ahead = (step(0.0, direction) * vec2(size_surface()) - center) / mix(direction, vec2(1e-6), equal(direction, vec2(0.0)));
    reach = min(abs(ahead.x), abs(ahead.y));
    return speed >= 1e-20;
}
