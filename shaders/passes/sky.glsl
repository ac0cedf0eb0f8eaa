// Share of the environment's light that reaches a surface past what the image shows, per colour channel. Directions are
// taken slice by slice: a slice is a half turn of the plane through the view ray, whose 32 sectors are marked as blocked by the
// surfaces met while walking along the slice's line on the screen. alpha: share of what the surface reflects of that light.
#include "lib/environment.glsl"
#include "lib/pi.glsl"
#include "lib/sampling.glsl"

const int SECTORS = 32;
const float SECTOR = PI / float(SECTORS);
const int GROUP = 4;                // sectors that share a lookup in the map: 22 degrees
const float BLURRED = 0.6;          // roughness of the map that is looked up, as wide as the gaps between slices

// The surface `coarser` levels above the one at hand.
Surface load_level(ivec2 px, int coarser) {
#ifdef HAS_SURFACE_1
    if (coarser == 1) return load_surface_1(px);
#endif
#ifdef HAS_SURFACE_2
    if (coarser == 2) return load_surface_2(px);
#endif
#ifdef HAS_SURFACE_3
    if (coarser == 3) return load_surface_3(px);
#endif
    return load_surface(px);
}

#include "lib/slices.glsl"

// Whether two places belong to one surface, or to two that meet: they share a plane, or their depths differ by no more than
// a slope of 63 degrees makes over their distance on the screen. Then all that lies between them is blocked, too.
bool connected(Seen a, Seen b, float apart) {
    vec3 way = b.position - a.position;
    float least = 0.1 * length(way);
    return abs(b.view_depth - a.view_depth) < 2.0 * apart * min(a.view_depth, b.view_depth)
        || (abs(dot(a.normal, way)) < least && abs(dot(b.normal, way)) < least);
}

// Bits of the sectors whose middle lies between two places, in sectors.
uint sectors_between(float low, float high) {
    int first = clamp(int(ceil(low - 0.5)), 0, SECTORS), end = clamp(int(ceil(high - 0.5)), 0, SECTORS);
    int count = end - first;
    if (count <= 0) return 0u;
    return (count >= 32 ? 0xFFFFFFFFu : (1u << uint(count)) - 1u) << uint(first);
}

// Marks what lies to one side of the point.
uint blocked_on(float side, Slice slice, vec3 p, vec2 center, float jitter) {
    vec2 direction;
    float reach;
    if (!find_line(side, slice, p, center, direction, reach)) return 0u;
    // All steps lie between the first texel and the edge of the image: what is not seen is open
    float growth = pow(max(reach, 1.0), 1.0 / float(steps)), radius = pow(growth, jitter);
    if (reach <= 1.0) return 0u;
    float texel_width = max(frame.ray_scale.x, frame.ray_scale.y) * texel;
    uint blocked = 0u;
    Seen before = Seen(p, vec3(0.0), 0.0);
    float before_angle = 0.0, before_radius = 0.0;
    int i = 0;
    do {
        vec2 at = clamp(center + direction * radius, vec2(0.0), vec2(size_surface()) - 0.5);
        int coarser = clamp(int(log2(radius * 0.25)), 0, coarsest);
        Seen met = seen_at(at, coarser);
        vec3 v = met.position - p, behind = met.position * (1.0 + thickness) - p;
        float spacing = (radius - before_radius) * texel_width;
        before_radius = radius;
        radius *= growth;
        if (met.view_depth <= 0.0) {
            before.view_depth = 0.0;
            continue;
        }
        float front_angle = angle_from_camera(slice, v);
        float back_angle = angle_from_camera(slice, behind);
        vec2 span = vec2(min(front_angle, back_angle), max(front_angle, back_angle));
        if (before.view_depth > 0.0 && connected(before, met, spacing))
            span = vec2(min(span.x, before_angle), max(span.y, before_angle));
        before = met;
        before_angle = front_angle;
        if (side < 0.0) span = -span.yx;
        span = (span - slice.turn) / SECTOR + 0.5 * float(SECTORS);
        blocked |= sectors_between(span.x, span.y);
    } while (++i < steps);
    return blocked;
}

// Adds the light of one slice: of all sectors above the horizon, and of the free ones.
void add_slice(Slice slice, float normal_length, uint blocked, inout vec3 all, inout vec3 free) {
    mat3 world_rotation = mat3(frame.world_from_view);
    float angle = slice.turn - 0.5 * PI + 0.5 * SECTOR;
    for (int first = 0; first < SECTORS; first += GROUP) {
        float whole = 0.0, open = 0.0;
        for (int i = 0; i < GROUP; ++i) {
            float weight = abs(sin(angle)) * max(cos(angle - slice.turn), 0.0);
            whole += weight;
            open += ((blocked >> uint(first + i)) & 1u) == 0u ? weight : 0.0;
            angle += SECTOR;
        }
        float middle = angle - 0.5 * float(GROUP + 1) * SECTOR;
        vec3 toward = world_rotation * (cos(middle) * slice.to_camera + sin(middle) * slice.along);
        vec3 radiance = environment_specular(texture_environment_specular,
                                             environment_direction(toward, frame.environment_turn), BLURRED);
        all += radiance * (whole * normal_length);
        free += radiance * (open * normal_length);
    }
}

#ifdef HAS_SPECULAR
#include "passes/sky_ahead.glsl"
#endif

void shade(ivec2 px) {
    out_sky_noisy = vec4(1.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec2 center = vec2(px) + 0.5;
    vec3 p = position_from_ray(ray_from_pixel(center, frame.ray_scale * texel, frame.ray_origin), surface.view_depth);
    Slice slice = first_slice(p);
    // Where a mean is taken, frames take turns at the 16, too; where none is, the pattern must not boil
    vec2 jitter = interleaved_4x4(px + (frame.unmoved > 0 ? ivec2(frame.jitter * 4.0) : ivec2(0)));
    vec3 all = vec3(0.0), free = vec3(0.0);
    int i = 0;
    do {
        float normal_length = turn_slice(slice, (float(i) + jitter.x) / (2.0 * float(directions)), surface.normal);
        uint blocked = blocked_on(1.0, slice, p, center, jitter.y) | blocked_on(-1.0, slice, p, center, jitter.y);
        add_slice(slice, normal_length, blocked, all, free);
    } while (++i < directions);
    // A channel without any light has no share; it counts as open
    vec3 shares = vec3(all.r > 0.0 ? free.r / all.r : 1.0, all.g > 0.0 ? free.g / all.g : 1.0,
                       all.b > 0.0 ? free.b / all.b : 1.0);
    float reflected = dot(shares, vec3(1.0 / 3.0));
#ifdef HAS_SPECULAR
    Kept kept = what_is_kept(px, surface, p);
    p = kept_position(px, surface, p, kept);
    if (kept.roughness >= 0.0)
        reflected = share_ahead(first_slice(p), p, surface.normal, kept.roughness, kept.center, jitter, reflected);
#endif
    out_sky_noisy = vec4(shares, reflected);
}
