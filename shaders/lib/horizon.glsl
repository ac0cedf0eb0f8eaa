// Which elevations around a receiver are blocked, as bits, in one half-plane of directions (Therrien et al. 2023).
//
// A row of samples that leads straight away from the receiver in the image lies in a plane with the camera. In its half
// on the row's side a direction is told by its angle to the direction of the camera, from 0 to where the receiver's own
// surface begins; 32 bits divide that range evenly.

struct HalfPlane {
    vec3 to_camera;
    float distance;         // of the receiver from the camera
    float inverse_span;     // of the angles above the receiver's surface, radians
};

// Within 1e-4 radians (Abramowitz and Stegun 4.4.45).
float fast_acos(float x) {
    float a = min(abs(x), 1.0);
    float y = sqrt(1.0 - a) * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - 0.0187293 * a)));
    return x < 0.0 ? 3.14159265 - y : y;
}

// position, normal: of the receiver, view space. along: the row's direction in the image, view space.
HalfPlane make_half_plane(vec3 position, vec3 normal, vec3 along) {
    float squared = max(dot(position, position), 1e-30), inverse_distance = inversesqrt(squared);
    vec3 to_camera = -position * inverse_distance;
    vec3 outward = along - to_camera * dot(along, to_camera);
    outward *= inversesqrt(max(dot(outward, outward), 1e-30));
    float up = dot(normal, to_camera), out_part = dot(normal, outward);
    float span = fast_acos(-out_part * inversesqrt(max(up * up + out_part * out_part, 1e-30)));
    return HalfPlane(to_camera, squared * inverse_distance, 1.0 / max(span, 1e-3));
}

// Elevation of what lies so far towards the camera from the receiver. 0: in the camera's direction, 1: along the receiver's
// surface, more: below it. inverse_length: of the whole offset.
float elevation(HalfPlane half_plane, float towards, float inverse_length) {
    return fast_acos(towards * inverse_length) * half_plane.inverse_span;
}

// Bits of the elevations from `low` to `high`. Rounded at both ends, so that narrow sectors add up without bias.
uint sector(float low, float high) {
    int first = int(clamp(low, 0.0, 1.0) * 32.0 + 0.5), count = int(clamp(high, 0.0, 1.0) * 32.0 + 0.5) - first;
    return count <= 0 ? 0u : (0xFFFFFFFFu >> uint(32 - count)) << uint(first);
}

// Elevations that a surface hides whose visible side is at `front`, and which reaches back from the camera by `thickness`, a
// share of its distance. towards: as of `elevation`. squared: of the length of its offset. The back is where the offset
// grown by the share, and that share of the way from camera to receiver, lead; two numbers are enough for its angle.
uint hidden_by(HalfPlane half_plane, float front, float towards, float squared, float thickness) {
    float grown = 1.0 + thickness, pushed = thickness * half_plane.distance;
    float back = grown * towards - pushed;
    float back_squared = grown * (grown * squared - 2.0 * pushed * towards) + pushed * pushed;
    return sector(front, elevation(half_plane, back, inversesqrt(max(back_squared, 1e-30))));
}

// Whether what is seen at an elevation hides behind the blocked ones. Below the surface nothing is known to block.
// A surface that faces the camera and the receiver is met from its far end on, each sample a little nearer to the camera
// than the one before: so many bits (up to a half) less are asked for, lest rounding make it hide itself.
bool sees_blocked(uint blocked, float at, float nearer) {
    return at < 1.0 && ((blocked >> uint(int(max(at * 32.0 - nearer, 0.0)))) & 1u) != 0u;
}
