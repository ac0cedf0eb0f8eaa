// The share of even light from all around that reaches a surface past what the image shows, weighted by the cosine: in each slice
// the highest horizon to either side, and the integral between the two in closed form. Only for comparison (docs/compare.md).
#include "lib/pi.glsl"

Surface load_level(ivec2 px, int coarser) { return load_surface(px); }

#include "lib/slices.glsl"

// XeGTAO's default: over the outer part of the radius a surface fades from blocking to not blocking.
const float FADE = 0.615;

// Within 1e-4 radians (Abramowitz and Stegun 4.4.45).
float fast_acos(float x) {
    float a = min(abs(x), 1.0);
    float y = sqrt(1.0 - a) * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - 0.0187293 * a)));
    return x < 0.0 ? PI - y : y;
}

// Cosine of the angle between the view ray and the horizon to one side; `lowest` where only the surface's own plane blocks.
float horizon_to(float side, Slice slice, vec3 p, vec2 center, float lowest, float jitter) {
    vec2 direction;
    float edge;
    if (!find_line(side, slice, p, center, direction, edge)) return lowest;
    // Nearer than a texel there is only the surface itself; beyond the edge of the image nothing is known
    float reach = min(edge, radius / (-p.z * max(frame.ray_scale.x, frame.ray_scale.y)));
    if (reach <= 1.0) return lowest;
    float highest = lowest;
    int i = 0;
    do {
        float share = (float(i) + jitter) / float(steps);
        vec2 at = clamp(center + direction * mix(1.0, reach, share * share), vec2(0.0), vec2(size_surface()) - 0.5);
        Seen met = seen_at(at, 0);
        if (met.view_depth <= 0.0) continue;
        vec3 way = met.position - p;
        float far = length(way);
        float weight = clamp((radius - far) / (radius * FADE), 0.0, 1.0);
        highest = max(highest, mix(lowest, dot(way, slice.to_camera) / max(far, 1e-15), weight));
    } while (++i < steps);
    return highest;
}

// Light between the view ray and an angle, weighted by the cosine to the normal: Jimenez et al.'s inner integral.
float arc(float angle, float turn) { return 0.25 * (cos(turn) + 2.0 * angle * sin(turn) - cos(2.0 * angle - turn)); }

void shade(ivec2 px) {
    out_ambient_noisy = vec4(0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 center = vec2(px) + 0.5;
    vec3 p = position_from_ray(ray_from_pixel(center, frame.ray_scale, frame.ray_origin), surface.view_depth);
    Slice slice = first_slice(p);
    vec2 jitter = fract(interleaved_4x4(px) + frame.jitter);
    float open = 0.0, whole = 0.0;
    int i = 0;
    do {
        float normal_length = turn_slice(slice, (float(i) + jitter.x) / (2.0 * float(slices)), surface.normal);
        float turn = slice.turn;
        float ahead = fast_acos(horizon_to(1.0, slice, p, center, cos(turn + 0.5 * PI), jitter.y));
        float behind = -fast_acos(horizon_to(-1.0, slice, p, center, cos(turn - 0.5 * PI), jitter.y));
        open += normal_length * (arc(ahead, turn) + arc(behind, turn));
        whole += normal_length * (cos(turn) + turn * sin(turn));
    } while (++i < slices);
    out_ambient_noisy = vec4(vec3(whole > 0.0 ? clamp(open / whole, 0.0, 1.0) : 1.0), 1.0);
}
