// Share of what a glossy surface reflects of the environment that arrives past what the image shows. Included by sky.glsl.
#include "lib/brdf.glsl"
#include "lib/luminance.glsl"
#include "passes/glossy_receiver.glsl"

// Sectors of a slice, and what is met in them.
struct Sectors {
    float middle;       // of all, as an angle from slice.to_camera
    float width;        // of each
    uint blocked;
    uint unsure;        // those of them of whose light the image tells nothing
};

// Marks what lies to one side of the point, in `count` steps. What is met takes the environment's place, so its light must come from
// the glossy gather, which brings that of faces that are within `gather_reach`, turned to the point and no mirrors: those reflect
// more than `mirror`.
// Nobody knows the light of what hides behind the faces either: here nothing has a thickness.
void look_ahead(float side, Slice slice, vec3 p, vec2 center, float jitter, int count, float mirror, inout Sectors sectors) {
    vec2 direction;
    float reach;
    if (!find_line(side, slice, p, center, direction, reach) || reach <= 1.0) return;
    float growth = pow(reach, 1.0 / float(count)), radius = pow(growth, jitter);
    float texel_width = max(frame.ray_scale.x, frame.ray_scale.y) * texel;
    Seen before = Seen(p, vec3(0.0), 0.0);
    float before_angle = 0.0, before_radius = 0.0, change = 0.0;
    bool was_joined = false, was_unsure = false;
    int i = 0;
    do {
        vec2 at = clamp(center + direction * radius, vec2(0.0), vec2(size_surface()) - 0.5);
        Seen met = seen_at(at, clamp(int(log2(radius * 0.25)), 0, coarsest));
        vec3 v = met.position - p;
        float angle = angle_from_camera(slice, v);
        bool joined = before.view_depth > 0.0 && met.view_depth > 0.0
                   && connected(before, met, (radius - before_radius) * texel_width);
        vec3 reflectance = load_specular(min(ivec2(at * texel), size_specular() - 1)).rgb;
        bool unsure = radius > gather_reach || dot(met.normal, v) > 0.0 || luminance(reflectance) > mirror;

        // A surface that begins or ends between two steps does so halfway: by so much of the next step or of the last one it
        // reaches farther
        float last_change = change;
        change = joined ? angle - before_angle : 0.0;
        vec2 ends = vec2(before_angle - (was_joined ? 0.0 : 0.5 * change), before_angle + (joined ? change : 0.5 * last_change));
        ends = (ends * side - sectors.middle) / sectors.width + 0.5 * float(SECTORS);
        uint marked = sectors_between(min(ends.x, ends.y), max(ends.x, ends.y));
        // What is nearer has been met before
        sectors.unsure |= (joined ? unsure : was_unsure) ? marked & ~sectors.blocked : 0u;
        sectors.blocked |= marked;
        before = met;
        before_angle = angle;
        before_radius = radius;
        was_joined = joined;
        was_unsure = unsure;
        radius *= growth;
    } while (++i < count);
}

// Angle from slice.to_camera up to which directions leave the image: that of the ray to where the slice's line ends.
float edge_angle(Slice slice, vec3 p, vec2 center) {
    vec2 direction;
    float reach;
    bool moves = find_line(1.0, slice, p, center, direction, reach);
    vec2 ray = ray_from_pixel(center + direction * reach, frame.ray_scale * texel, frame.ray_origin);
    return moves ? angle_from_camera(slice, vec3(ray, -1.0)) : PI;
}

// The lobe is that of the glossy gather. Its axis, the mirror direction, lies in the slice through the normal, as far beyond it as
// the camera is before; sectors fill the cone that holds the lobe. What is beside the slice counts as what is in it.
// diffuse: share of the whole hemisphere's light that arrives.
float share_ahead(Slice slice, vec3 p, vec3 normal, float roughness, vec2 center, vec2 jitter, float diffuse) {
    float facing = dot(normal, slice.to_camera);
    vec3 sideways = normal - slice.to_camera * facing;
    float aside = length(sideways);
    slice.along = aside > 1e-4 ? sideways / aside : slice.across;
    slice.turn = atan(aside, facing);
    float exponent = phong_exponent(roughness), cone = acos(lobe_cone_cos(exponent)), mirror = 2.0 * slice.turn;
    Sectors sectors = Sectors(mirror, 2.0 * cone / float(SECTORS), 0u, 0u);
    // Few cones reach to the other side of the view ray: all other slices have the steps of both sides for one
    int sides = mirror < cone ? 2 : 1, i = 0;
    float side = 1.0;
    do {
        // Of a half mirror, every other texel is a mirror
        look_ahead(side, slice, p, center, jitter.y, 2 * steps / sides, jitter.x, sectors);
        side = -side;
    } while (++i < sides);

    // Nobody has looked where free directions go that leave the image. There and where the light is unknown, the hemisphere tells
    // more than nothing
    float edge = edge_angle(slice, p, center), unknown = specular_occlusion(max(facing, 0.0), diffuse, roughness);
    mat3 world_rotation = mat3(frame.world_from_view);
    float all = 0.0, free = 0.0, angle = mirror - cone + 0.5 * sectors.width;
    for (int first = 0; first < SECTORS; first += GROUP) {
        float whole = 0.0, open = 0.0;
        for (int k = 0; k < GROUP; ++k) {
            // The integral of lobe times cosine across the slice has the same shape along it
            float weight = pow(max(cos(angle - mirror), 1e-6), exponent) * max(cos(angle - slice.turn), 0.0);
            float shown = clamp((angle - edge) / sectors.width + 0.5, 0.0, 1.0);
            uint bit = 1u << uint(first + k);
            float share = (sectors.unsure & bit) != 0u ? unknown
                        : (sectors.blocked & bit) != 0u ? 0.0 : mix(unknown, 1.0, shown);
            whole += weight;
            open += weight * share;
            angle += sectors.width;
        }
        float middle = angle - 0.5 * float(GROUP + 1) * sectors.width;
        vec3 toward = world_rotation * (cos(middle) * slice.to_camera + sin(middle) * slice.along);
        float light = luminance(environment_specular(texture_environment_specular,
                                environment_direction(toward, frame.environment_turn), 0.5 * roughness));
        all += light * whole;
        free += light * open;
    }
    // The wider the lobe, the less of it is in the slice
    return mix(all > 0.0 ? free / all : 1.0, diffuse, LEAST_EXPONENT / exponent);
}
