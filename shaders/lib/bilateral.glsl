// Weights of cross-bilateral filters over surfaces.

// Distance to the plane at which a tap's weight is halved, relative to the view depth.
const float PLANE_TOLERANCE = 0.01;

// Agreement of a tap with a receiver at p: of their normals, and of the tap's distance to the receiver's tangent plane.
float agreement(Surface receiver, vec3 p, Surface tap, vec2 tap_ray) {
    float facing = max(dot(receiver.normal, tap.normal), 0.0);
    facing *= facing;
    facing *= facing;
    float off_plane = dot(receiver.normal, position_from_ray(tap_ray, tap.view_depth) - p)
                    / (receiver.view_depth * PLANE_TOLERANCE);
    return tap.view_depth > 0.0 ? facing * facing / (1.0 + off_plane * off_plane) : 0.0;
}
