// Places on the tangent plane of a surface.

// How a surface's tangent plane is met by the view ray through a place.
struct OnPlane {
    vec2 ray;
    float slant;            // dot(normal, vec3(ray, -1))
    float depth;            // it stays near that of the texel, whose plane may be seen at a grazing angle
};

// place: in texels; at: the texel around it.
OnPlane on_plane(Surface surface, ivec2 at, vec2 place, vec2 scale) {
    vec2 ray = ray_from_pixel(place, scale, frame.ray_origin);
    vec2 center = ray_from_pixel(vec2(at) + 0.5, scale, frame.ray_origin);
    float slant = dot(surface.normal, vec3(ray, -1.0)), at_center = dot(surface.normal, vec3(center, -1.0));
    float moved = min(at_center, -1e-4) / min(slant, -1e-4);
    return OnPlane(ray, slant, surface.view_depth * clamp(moved, 0.9, 1.1));
}
