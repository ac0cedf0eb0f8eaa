// Irradiance from areas that emit evenly, clipped to the receiver's horizon. Each function returns E / L: the integral of
// the cosine over the visible solid angle, 0 to pi. Vectors are relative to the receiver; n is its unit normal.
#include "lib/pi.glsl"

// One edge of Lambert's sum: the angle between its ends, times the cosine between n and the edge's plane normal.
float edge_irradiance(vec3 a, vec3 b, vec3 n) {
    vec3 across = cross(a, b);
    float squared = dot(across, across);
    if (squared <= 0.0) return 0.0;
    // The arctangent keeps small angles exact where an arc cosine would lose them
    float length_ = sqrt(squared);
    return atan(length_, dot(a, b)) * dot(n, across) / length_;
}

// A convex polygon, edge by edge, cut at the horizon: what lies below it is left out, and one more edge along the horizon
// closes the rest (Lambert 1760; Baum et al. 1989 for the clipping).
struct ClippedPolygon {
    float sum;
    vec3 leaves, enters;    // where the outline goes below the horizon and comes up again
    bool is_cut;
};

ClippedPolygon start_polygon() { return ClippedPolygon(0.0, vec3(0.0), vec3(0.0), false); }

void add_edge(inout ClippedPolygon polygon, vec3 a, vec3 b, vec3 n) {
    float above_a = dot(n, a), above_b = dot(n, b);
    if (above_a <= 0.0 && above_b <= 0.0) return;
    if (above_a > 0.0 && above_b > 0.0) {
        polygon.sum += edge_irradiance(a, b, n);
        return;
    }
    vec3 crossing = mix(a, b, above_a / (above_a - above_b));
    polygon.is_cut = true;
    if (above_a > 0.0) {
        polygon.sum += edge_irradiance(a, crossing, n);
        polygon.leaves = crossing;
    } else {
        polygon.sum += edge_irradiance(crossing, b, n);
        polygon.enters = crossing;
    }
}

// The outline may run either way round.
float polygon_irradiance(ClippedPolygon polygon, vec3 n) {
    float sum = polygon.sum;
    if (polygon.is_cut) sum += edge_irradiance(polygon.leaves, polygon.enters, n);
    return 0.5 * abs(sum);
}

// E / L of a small flat area far away: cos cos' A / r^2.
float far_irradiance(vec3 center, vec3 direction, float area, vec3 n) {
    float squared = dot(center, center);
    return max(dot(n, center), 0.0) * max(-dot(direction, center), 0.0) * area / (squared * squared);
}

// Seen from this many radii away, an area counts as a point: the error is the inverse square, and single precision would
// begin to lose the difference of the edges.
const float FAR_AWAY = 100.0;

// half_u, half_v: half the sides, as vectors. direction: the side that emits.
float rectangle_irradiance(vec3 center, vec3 half_u, vec3 half_v, vec3 direction, vec3 n) {
    if (dot(direction, center) >= 0.0) return 0.0;
    float reach_squared = dot(half_u, half_u) + dot(half_v, half_v);
    if (dot(center, center) > FAR_AWAY * FAR_AWAY * reach_squared)
        return far_irradiance(center, direction, 4.0 * sqrt(dot(half_u, half_u) * dot(half_v, half_v)), n);
    vec3 a = center - half_u - half_v, b = center + half_u - half_v;
    vec3 c = center + half_u + half_v, d = center - half_u + half_v;
    ClippedPolygon polygon = start_polygon();
    add_edge(polygon, a, b, n);
    add_edge(polygon, b, c, n);
    add_edge(polygon, c, d, n);
    add_edge(polygon, d, a, n);
    return polygon_irradiance(polygon, n);
}

// u: a unit vector in the disc's plane. Wholly above the horizon: the closed form for a disc and an element of any
// orientation (Howell, configurations B-12 and B-13, written without differences of nearly equal numbers); cut by it: a
// polygon of the disc's area.
float disc_irradiance(vec3 center, float radius, vec3 u, vec3 direction, vec3 n) {
    const int EDGES = 32;
    const float SAME_AREA = 1.0032221;      // sqrt(2 pi / (32 sin(2 pi / 32)))
    float h = -dot(direction, center);      // height of the receiver over the disc's plane
    if (h <= 0.0) return 0.0;
    float middle = dot(n, center), facing = dot(n, direction);
    float rise = radius * sqrt(max(1.0 - facing * facing, 0.0));
    if (middle + rise <= 0.0) return 0.0;
    if (middle - rise >= 0.0) {
        vec3 inward = center + direction * h;                   // to the disc's axis
        float rho = length(inward), squared = radius * radius;
        float minus = rho - radius, plus = rho + radius;
        float s = sqrt((h * h + minus * minus) * (h * h + plus * plus));
        float sum = s + h * h + rho * rho + squared;
        float straight = squared * (1.0 - 2.0 * rho * rho / sum) / s;
        float sideways = 2.0 * h * squared / (sum * s);         // over rho, which `inward` has
        return PI * max(-facing * straight + dot(n, inward) * sideways, 0.0);
    }
    vec3 v = cross(direction, u);
    ClippedPolygon polygon = start_polygon();
    vec3 previous = center + u * (radius * SAME_AREA);
    for (int i = 1; i <= EDGES; ++i) {
        float angle = float(i) * (2.0 * PI / float(EDGES));
        vec3 next = center + (u * cos(angle) + v * sin(angle)) * (radius * SAME_AREA);
        add_edge(polygon, previous, next, n);
        previous = next;
    }
    return polygon_irradiance(polygon, n);
}

// A sphere, also partly below the horizon: Snyder 1996, "Area light sources for real-time graphics". Nothing inside it.
float sphere_irradiance(vec3 center, float radius, vec3 n) {
    float squared = dot(center, center);
    float sin2 = radius * radius / squared;                     // of the half angle that it fills
    if (!(sin2 < 1.0)) return 0.0;
    float cosine = dot(n, center) * inversesqrt(squared);
    if (cosine * abs(cosine) >= sin2) return PI * sin2 * cosine;
    if (cosine * abs(cosine) <= -sin2) return 0.0;
    float sine = sqrt(max(1.0 - cosine * cosine, 1e-12));
    float x = sqrt(1.0 / sin2 - 1.0);
    float y = clamp(-x * cosine / sine, -1.0, 1.0);
    float rest = sine * sqrt(1.0 - y * y);
    return max((cosine * acos(y) - x * rest) * sin2 + atan(rest, x), 0.0);
}
