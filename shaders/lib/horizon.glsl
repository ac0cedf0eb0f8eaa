// Which elevations around a receiver are blocked, as bits, in one half-plane of directions (Therrien et al. 2023).
//
// A row of samples that leads straight away from the receiver in the image lies in a plane with the camera. In its half
// on the row's side a direction is told by its elevation, from the direction of the camera to where the receiver's own surface
// begins; 32 bits divide that range evenly. It is measured along a diamond instead of a circle: as good for telling which of two
// directions is higher, for a division instead of roots and an arc cosine.

struct HalfPlane {
    vec3 to_camera, outward;    // unit vectors that span it
    float distance;             // of the receiver from the camera
    float inverse_span;         // of the elevations above the receiver's surface
};

// Along the diamond |outward| + |towards| = 1, outward not negative: 0 in the camera's direction, 1 across, 2 away from it.
float along_diamond(float outward, float towards) {
    return 1.0 - towards / max(outward + abs(towards), 1e-30);
}

// What all half-planes of a receiver share: `outward` and `inverse_span` are those of one.
HalfPlane half_planes_of(vec3 position) {
    float squared = max(dot(position, position), 1e-30), inverse_distance = inversesqrt(squared);
    return HalfPlane(-position * inverse_distance, vec3(0.0), squared * inverse_distance, 1.0);
}

// position, normal: of the receiver, view space. along: the row's direction in the image, view space.
HalfPlane make_half_plane(vec3 position, vec3 normal, vec3 along) {
    HalfPlane half_plane = half_planes_of(position);
    vec3 outward = along - half_plane.to_camera * dot(along, half_plane.to_camera);
    outward *= inversesqrt(max(dot(outward, outward), 1e-30));
    float span = along_diamond(abs(dot(normal, half_plane.to_camera)), -dot(normal, outward));
    half_plane.outward = outward;
    half_plane.inverse_span = 1.0 / max(span, 1e-3);
    return half_plane;
}

// Takes the half-plane in which something lies, and returns its place there; `outward` is not set.
// squared: length of the offset. normal_height: dot(normal, offset). normal_facing: dot(normal, to_camera).
vec2 turn_to(inout HalfPlane half_plane, vec3 offset, float squared, float normal_height, float normal_facing) {
    float towards = dot(offset, half_plane.to_camera), outward = sqrt(max(squared - towards * towards, 0.0));
    // `make_half_plane` with both numbers times `outward`
    float camera_side = abs(normal_facing) * outward, out_side = towards * normal_facing - normal_height;
    float both = max(camera_side + abs(out_side), 1e-30);
    half_plane.inverse_span = both / max(both - out_side, 1e-3 * both);
    return vec2(outward, towards);
}

// Where something is in the half-plane: how far outward and how far towards the camera from the receiver.
vec2 in_half_plane(HalfPlane half_plane, vec3 offset) {
    return vec2(dot(offset, half_plane.outward), dot(offset, half_plane.to_camera));
}

// The view rays of a row of samples. The half-plane's plane holds the camera, too: their points at depth 1 lie there, on a line.
struct RowRays {
    vec2 start, step;           // as `in_half_plane`, but from the camera: at the receiver, and what a texel of the row adds
};

// along: the row's direction in the image, view space; depth: the receiver's view depth.
RowRays rays_of_row(HalfPlane half_plane, vec3 along, float depth) {
    return RowRays(vec2(0.0, -half_plane.distance / depth), in_half_plane(half_plane, along));
}

// As `in_half_plane` of what lies at a view depth on the ray `texels` from the receiver.
vec2 in_half_plane(HalfPlane half_plane, RowRays rays, float texels, float depth) {
    return vec2(0.0, half_plane.distance) + (rays.start + rays.step * texels) * depth;
}

// 0: in the camera's direction, 1: along the receiver's surface, more: below it.
float elevation(HalfPlane half_plane, vec2 place) {
    return along_diamond(place.x, place.y) * half_plane.inverse_span;
}

// Bits of the elevations from `low` to `high`. Rounded at both ends, so that narrow sectors add up without bias.
uint sector(float low, float high) {
    int first = int(clamp(low, 0.0, 1.0) * 32.0 + 0.5), count = int(clamp(high, 0.0, 1.0) * 32.0 + 0.5) - first;
    return count <= 0 ? 0u : (0xFFFFFFFFu >> uint(32 - count)) << uint(first);
}

// Elevations that a surface at `place` hides whose visible side is at `front`, and which reaches back from the camera by
// `thickness`, a share of its distance. Its back is on the same view ray, 1 + thickness times as far from the camera, and so from
// the receiver as far out as that, and farther back by the share of the receiver's own distance.
uint hidden_by(HalfPlane half_plane, float front, vec2 place, float thickness) {
    vec2 back = place * (1.0 + thickness) - vec2(0.0, thickness * half_plane.distance);
    return sector(front, elevation(half_plane, back));
}

// Whether what is seen at an elevation hides behind the blocked ones. Below the surface nothing is known to block.
// A surface that faces the camera and the receiver is met from its far end on, each sample a little nearer to the camera
// than the one before: so many bits (up to a half) less are asked for, lest rounding make it hide itself.
bool sees_blocked(uint blocked, float at, float nearer) {
    return at < 1.0 && ((blocked >> uint(int(max(at * 32.0 - nearer, 0.0)))) & 1u) != 0u;
}
