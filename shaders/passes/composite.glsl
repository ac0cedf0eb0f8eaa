// The picture: direct light plus albedo times irradiance over pi, then exposure, tone mapping and the one and
// only sRGB encoding. SHOW: 0 both, 1 direct, 2 indirect. TONE_MAP: 0 aces, 1 neutral, 2 reinhard, 3 linear.
// Here the guard band is cut off: `band` is where the image begins in what was rendered.
#include "lib/color.glsl"

const float PI = 3.141592653589793;

// Half a code value of noise, so that dark gradients do not band. Interleaved gradient noise (Jimenez 2014).
float dither(ivec2 px) {
    return fract(52.9829189 * fract(dot(vec2(px), vec2(0.06711056, 0.00583715)))) - 0.5;
}

void shade(ivec2 px) {
    vec3 indirect = vec3(0.0);
#ifdef HAS_IRRADIANCE
    indirect = load_albedo(px + band).rgb * vec3(load_irradiance(px + band)) * (1.0 / PI);
#endif
    vec3 direct = load_direct(px + band).rgb;
#if SHOW == 0
    vec3 color = direct + indirect;
#elif SHOW == 1
    vec3 color = direct;
#else
    vec3 color = indirect;
#endif
#ifdef WRITE_FINAL
    out_final = vec4(finite_half(direct + indirect), 1.0);
#endif
    color = finite_half(color * frame.exposure);
#if TONE_MAP == 0
    color = tone_map_aces(color);
#elif TONE_MAP == 1
    color = tone_map_neutral(color);
#elif TONE_MAP == 2
    color = tone_map_reinhard(color);
#endif
    out_display = vec4(srgb_from_linear(color) + dither(px) / 255.0, 1.0);
}
