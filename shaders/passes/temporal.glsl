// Reverse reprojection: each pixel looks up where its surface was in the last frame and goes on with the
// running mean that it finds there. alpha of the history: number of frames in the mean.
#include "lib/reproject.glsl"

void shade(ivec2 px) {
    out_irradiance = vec4(0.0);
    Surface surface = load_surface(px);
    if (surface.view_depth <= 0.0) return;
    vec3 current = load_upsample(px);
    out_irradiance = vec4(current, 1.0);
    if (frame.history_frames == 0) return;

    vec4 history;
    if (!find_history(px, surface, 0.8, history)) return;

    // Light that changed, a moving lamp or a door that opens, must not be averaged away: where the new value,
    // which the upsampling has smoothed, is far from the mean, the mean is shortened.
    const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
    float new_light = dot(current, LUMINANCE), old_light = dot(history.rgb, LUMINANCE);
    float change = abs(new_light - old_light) / max(max(new_light, old_light), 1e-6);
    float longest = mix(float(frame.history_frames), 2.0, smoothstep(0.5, 0.9, change));
    float count = min(history.a + 1.0, longest);
    out_irradiance = vec4(mix(history.rgb, current, 1.0 / count), count);
}
