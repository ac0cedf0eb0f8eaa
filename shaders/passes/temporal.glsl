// Reverse reprojection: each pixel looks up where its surface was in the last frame and goes on with the
// running means that it finds there, of irradiance and of what glossy surfaces reflect. Both in one pass, since most of
// the work is the same. alpha of the irradiance: number of frames in the mean.
#include "lib/lobe.glsl"
#include "lib/luminance.glsl"
#include "lib/reproject.glsl"

const float COARSE_REACH = 0.05;
#ifdef HAS_GLOSSY_LIGHT
#include "passes/glossy_to_image.glsl"
#endif

// Factors on the light of the last frame's texels that turn it to the normal of now. A mean of what neighbours had on their
// own normals loses the relief of normal maps with each frame that moves, and the lobe knows what light on another one would be.
vec3 turned(ivec2 px, Surface surface, Previous previous) {
#if defined HAS_LIGHT && !defined STILL
    ivec2 at = min(px / 2, size_light() - 1);
    Surface coarse = load_coarse_surface(at);
    if (abs(coarse.view_depth - surface.view_depth) < COARSE_REACH * surface.view_depth) {
        Lobe lobe = load_light(at);
        float here = lobe_share(lobe, coarse.normal, surface.normal);
        mat3 before = mat3(frame.previous_view_from_view);
        lobe.direction = before * lobe.direction;
        vec3 normal = before * coarse.normal;
        vec3 factors;
        for (int i = 0; i < 3; ++i)
            factors[i] = clamp(here / lobe_share(lobe, normal, previous.normals[i]), 0.5, 2.0);
        return factors;
    }
#endif
    return vec3(1.0);
}

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
    float longest = mix(float(frame.history_frames), 2.0, changed);
    float count = min(history.a + 1.0, longest);
    return vec4(mix(history.rgb, current, 1.0 / count), count);
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
    // What moves over the screen reflects something else than before: fewer frames, the more so the smoother it is.
    float still = 1.0 - smoothstep(0.25, 1.0, length(previous.moved));
    float count = min(frames, mix(mix(4.0, 16.0, now.roughness), frames, still));
#endif
    // The history may be what the texels around have gathered now, give or take twice their spread: with once, its
    // rare peaks were cut off and the mean fell by 1 %
    vec3 low = now.radiance * max(0.75 - 2.0 * now.spread, 0.0), high = now.radiance * (1.25 + 2.0 * now.spread);
    return mix(clamp(history, low, high), now.radiance, 1.0 / count);
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
