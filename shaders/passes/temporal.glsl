// Reverse reprojection: each pixel looks up where its surface was in the last frame and goes on with the
// running means that it finds there, of irradiance and of what glossy surfaces reflect. Both in one pass, since most of
// the work is the same. alpha of the irradiance: number of frames in the mean.
#include "lib/lobe.glsl"
#include "lib/luminance.glsl"
#include "lib/reproject.glsl"
#ifdef HAS_GLOSSY_LIGHT
#include "passes/glossy_to_image.glsl"
#endif

#if defined(HAS_LIGHT) && !defined(STILL)
// Of the coarse texel around a pixel: where its light comes from, in the view spaces of this frame and of the last one.
struct CoarseLight {
    Lobe lobe, old_lobe;
    vec3 normal, old_normal;
    float view_depth;
};

CoarseLight coarse_light_at(ivec2 px) {
    ivec2 at = min(px / 2, size_light() - 1);
    Surface surface = load_coarse_surface(at);
    Lobe lobe = load_light(at);
    mat3 old = mat3(frame.previous_view_from_view);
    return CoarseLight(lobe, Lobe(lobe.flux, old * lobe.direction, lobe.back), surface.normal, old * surface.normal,
                       surface.view_depth);
}

#ifdef BLOCK
// Four pixels have one coarse texel around them.
CoarseLight block_light;
void load_with_light(ivec2 first) {
    block_light = coarse_light_at(first);
#ifdef LOAD_BLOCK
    LOAD_BLOCK(first);
#endif
}
#undef LOAD_BLOCK
#define LOAD_BLOCK load_with_light
CoarseLight coarse_light(ivec2 px) { return block_light; }
#else
CoarseLight coarse_light(ivec2 px) { return coarse_light_at(px); }
#endif

// Difference in depth, relative, up to which the coarse texel may be of the pixel's own surface.
const float COARSE_REACH = 0.05;
// Share of the turn that is made: all of it keeps all relief, and lets more of it and of the lobe's own noise flicker.
const float TURN = 0.5;

// Factors on the light of the last frame's texels that turn it towards the normal of now: a mean of what neighbours had on their
// own normals would lose the relief of normal maps with each frame that moves.
vec3 turned(ivec2 px, Surface surface, Previous previous) {
    if (frame.still == 1 || frame.history_frames == 0) return vec3(1.0);    // the same normals, or none
    CoarseLight light = coarse_light(px);
    float here = lobe_share(light.lobe, light.normal, surface.normal);
    vec3 shares;
    for (int i = 0; i < 3; ++i) shares[i] = lobe_share(light.old_lobe, light.old_normal, previous.normals[i]);
    bool is_own = abs(light.view_depth - surface.view_depth) < COARSE_REACH * surface.view_depth;
    return is_own ? mix(vec3(1.0), clamp(here / shares, 0.5, 2.0), TURN) : vec3(1.0);
}
#else
vec3 turned(ivec2 px, Surface surface, Previous previous) { return vec3(1.0); }
#endif

vec4 averaged_irradiance(ivec2 px, Surface surface, Previous previous) {
    vec3 current = load_upsample(px);
    vec4 history;
    vec3 factors = turned(px, surface, previous);
    if (frame.history_frames == 0 || !find_history(previous, factors, history)) return vec4(current, 1.0);

    // Light that changed, a moving lamp or a door that opens, must not be averaged away: where the new value,
    // which the upsampling has smoothed, is far from the mean, the mean is shortened. Where nothing has moved for a while, what
    // differs is noise: rare bright samples of rays would get half of the weight.
    float new_light = luminance(current), old_light = luminance(history.rgb);
    float change = abs(new_light - old_light) / max(max(new_light, old_light), 1e-6);
#ifdef STILL
    float changed = 0.0;
#else
    float changed = frame.still == 1 ? 0.0 : smoothstep(0.5, 0.9, change);
#endif
    float longest = mix(float(frame.history_frames), frame.changed_frames, changed);
    float count = min(history.a + 1.0, longest);
    // Turned light may be more than half floats hold, and an infinite mean would stay so and spread to whoever finds it
    return vec4(finite_half(mix(history.rgb, current, 1.0 / count)), count);
}

#ifdef HAS_GLOSSY_LIGHT
// frames: in the mean of the irradiance, which is that of the reflection's, too.
vec3 averaged_reflection(ivec2 px, Surface surface, Previous previous, float frames) {
    vec4 specular = load_specular(px);
    if (!is_reflecting(specular)) return vec3(0.0);
    Reflection now = reflection_at(px, surface, specular.a);
    // Tighter in normal than for irradiance: a mirror direction turns twice as far
    vec3 weights = alike(previous, 0.9);
    float total = weights.x + weights.y + weights.z;
    if (frames <= 1.0 || total < LEAST_FOUND) return now.radiance;
    vec3 history = vec3(0.0);
    for (int i = 0; i < TAPS; ++i) history += load_reflection_history(previous.at[i]) * (weights[i] / total);
#ifdef STILL
    float count = frames;
#else
    bool still = frame.still == 1;
    // Where anything moves, a surface may reflect something else than before, also one that stands still in the image, as at
    // the pivot of an orbit: fewer frames, the more so the smoother it is.
    float count = still ? frames : min(frames, mix(4.0, 16.0, now.roughness));
    // The history may be what the texels around have gathered now, give or take twice their spread: with once, its
    // rare peaks were cut off and the mean fell by 1 %. Where nothing has moved for a while, what differs is noise: where few rows
    // find a small bright thing close by, most frames would take out what others had found
    vec3 low = now.radiance * max(0.75 - 2.0 * now.spread, 0.0), high = now.radiance * (1.25 + 2.0 * now.spread);
    if (!still) history = clamp(history, low, high);
#endif
    return mix(history, now.radiance, 1.0 / count);
}
#endif

void shade(ivec2 px) {
    out_irradiance = vec4(0.0);
#ifdef HAS_GLOSSY_LIGHT
    out_reflection = vec3(0.0);
#endif
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    Previous previous = find_previous(px, surface);
    out_irradiance = averaged_irradiance(px, surface, previous);
#ifdef HAS_GLOSSY_LIGHT
    out_reflection = averaged_reflection(px, surface, previous, out_irradiance.a);
#endif
}
