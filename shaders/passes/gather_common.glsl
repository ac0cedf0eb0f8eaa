// What diffuse and glossy gather share: receivers, senders, and where samples lie. Included after the definitions
// FORM_FACTOR: 0 disc, 1 point. SPACING: 0 even in radius, 1 even in area. VISIBILITY: 0 off, 1 voxel, 2 horizon.
// Needs the uniform `texel`: width of a texel of this level in level-0 pixels.
#include "lib/pi.glsl"
#include "lib/on_plane.glsl"
#if VISIBILITY == 1
#include "lib/voxels.glsl"
#ifndef HAS_VOXELS_FAR
#define texture_voxels_far texture_voxels
#endif
#elif VISIBILITY == 2
#include "lib/horizon.glsl"
#endif

struct Receiver {
    ivec2 px;
    vec3 position;
    vec3 normal;
};

// A texel as it looks from the receiver.
struct Sender {
    ivec2 px;
    vec3 position;
    float view_depth;       // 0: background
    vec3 normal;
    vec3 offset;            // from the receiver
    float distance_squared;
    float inverse_distance;
};

Sender sender_at(Receiver receiver, ivec2 at, Surface surface, vec3 position) {
    vec3 offset = position - receiver.position;
    float squared = dot(offset, offset);
    return Sender(at, position, surface.view_depth, surface.normal, offset, squared, inversesqrt(max(squared, 1e-30)));
}

// False where there is nothing to look at: off screen, the receiver itself. It is asked before looking, and afterwards whether
// anything was seen: CPUs would copy under a mask all that a function with several returns finds.
bool may_see(Receiver receiver, ivec2 at) {
#ifdef ZERO_OUTSIDE
    return at != receiver.px;   // off screen there is background
#else
    return is_on_screen(at, size_surface()) && at != receiver.px;
#endif
}

bool is_seen(Sender sender) { return sender.view_depth > 0.0 && sender.distance_squared > 0.0; }

Sender look_at(Receiver receiver, ivec2 at) {
    Surface surface = load_surface(at);
    vec2 ray = ray_from_pixel(vec2(at) + 0.5, frame.ray_scale * texel, frame.ray_origin);
    return sender_at(receiver, at, surface, position_from_ray(ray, surface.view_depth));
}

// The same at a place between texel centres; at: the texel around it.
Sender look_at_place(Receiver receiver, ivec2 at, vec2 place) {
    Surface surface = load_surface(at);
    OnPlane there = on_plane(surface, at, place, frame.ray_scale * texel);
    return sender_at(receiver, at, surface, position_from_ray(there.ray, there.depth));
}

// R^2 of the disc that stands for one texel of the sender, as the receiver sees it: `above` / `below`.
// R^2 = cos' dA / pi, dA = a z^3 / |n . Q|. Both are times the distance, which so divides nothing. 0 above: the sender faces
// away, or there is none.
struct Disc {
    float above, below;
};

// facing: -dot(normal, offset). away: -dot(normal, position); least: what it is held above, since a surface seen at a grazing
// angle would count for infinitely much. scale: of rays, from texel to texel.
Disc disc_of_texel(float facing, float away, float least, float view_depth, float squared, vec2 scale) {
    return Disc(max(facing, 0.0) * (scale.x * scale.y * (1.0 / PI)) * (view_depth * view_depth * view_depth),
                max(away, least) * sqrt(squared));
}

// The cosine is held above some 1 %.
Disc disc_of_texel(Sender sender, vec2 scale) {
    return disc_of_texel(-dot(sender.normal, sender.offset), -dot(sender.normal, sender.position),
                         -0.01 * sender.position.z, sender.view_depth, sender.distance_squared, scale);
}

Disc texel_disc(Sender sender) { return disc_of_texel(sender, frame.ray_scale * texel); }

// Form factor of a sender that stands for `texels` texels of its surface; disc: its `texel_disc`. squared: its distance.
float form_factor(float squared, Disc disc, float texels) {
    float away = squared * disc.below;
#if FORM_FACTOR == 1
    return texels * disc.above / away;
#elif SPACING == 0
    // The disc is the texel's own: a close sample stands for few texels, so the sum stays finite, and it tends to
    // the sum over all texels where a disc of the whole strip's area would stay below it.
    return texels * disc.above / (away + disc.above);
#else
    // The disc is all that the sample stands for: what tames samples that are few near the receiver
    return texels * disc.above / (away + texels * disc.above);
#endif
}

float form_factor(Sender sender, Disc disc, float texels) { return form_factor(sender.distance_squared, disc, texels); }

float form_factor(Sender sender, float texels) { return form_factor(sender, texel_disc(sender), texels); }

// Samples between two radii. Spaced evenly in radius, near senders, whose light varies fastest, get most of the
// samples, and each stands for the area of its own strip; spaced evenly in area, as in the talk, all stand for the same
// (docs/method/gather.md).
struct Ring {
    float from, step;       // radius, or its square
};

Ring make_ring(float from, float to, int count) {
    float share = 1.0 / float(max(count, 1));
#if SPACING == 0
    return Ring(from, (to - from) * share);
#else
    return Ring(from * from, (to * to - from * from) * share);
#endif
}

// Radius of a sample and the area in texels that it stands for, per radian. at: from 0 to the number of samples.
vec2 ring_place(Ring ring, float at) {
    float reached = ring.from + at * ring.step;
#if SPACING == 0
    return vec2(reached, reached * ring.step);
#else
    return vec2(sqrt(reached), 0.5 * ring.step);
#endif
}
