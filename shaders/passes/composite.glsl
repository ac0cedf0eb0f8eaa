// The picture: direct light plus albedo times irradiance over pi plus glossy reflection, then exposure, tone mapping and sRGB
// encoding. SHOW: 0 both, 1 direct, 2 indirect, 3 glossy. TONE_MAP: 0 aces, 1 neutral, 2 reinhard, 3 linear.
// Here the guard band is cut off: `band` is where the image begins in what was rendered.
#include "lib/brdf.glsl"
#include "lib/color.glsl"
#include "lib/luminance.glsl"

// Half a code value of noise, so that dark gradients do not band. Interleaved gradient noise (Jimenez 2014).
float dither(ivec2 px) {
    return fract(52.9829189 * fract(dot(vec2(px), vec2(0.06711056, 0.00583715)))) - 0.5;
}

#ifdef HAS_REFLECTION
vec3 glossy_reflection(ivec2 at) {
    Surface surface = load_surface(at);
    vec4 specular = load_specular(at);
    vec2 ray = ray_from_pixel(vec2(at) + 0.5, frame.ray_scale, frame.ray_origin);
    float n_dot_v = (surface.normal.z - dot(surface.normal.xy, ray)) * inversesqrt(dot(ray, ray) + 1.0);
    return load_reflection(at) * fresnel_rough(specular.rgb, specular.a, n_dot_v);
}
#endif

void shade(ivec2 px) {
    vec3 indirect = vec3(0.0), glossy = vec3(0.0);
#ifdef HAS_IRRADIANCE
    indirect = load_albedo(px + band).rgb * vec3(load_irradiance(px + band)) * (1.0 / PI);
#endif
#ifdef HAS_REFLECTION
    glossy = glossy_reflection(px + band);   // a half float holds what is stored, times at most 1
#endif
    vec3 direct = vec3(load_direct(px + band));
#if SHOW == 0
    vec3 color = direct + indirect + glossy;
#elif SHOW == 1
    vec3 color = direct;
#elif SHOW == 2
    vec3 color = indirect + glossy;
#else
    vec3 color = glossy;
#endif
#ifdef WRITE_FINAL
    out_final = vec4(finite_half(direct + indirect + glossy), 1.0);
#endif
#ifdef WRITE_GLOSSY
    out_glossy = vec4(glossy, 1.0);
#endif
    color = finite_half(color * frame.exposure);
#if TONE_MAP == 0
    color = tone_map_aces(color);
#elif TONE_MAP == 1
    color = tone_map_neutral(color);
#elif TONE_MAP == 2
    color = tone_map_reinhard(color);
#endif
    vec3 code = srgb_from_linear(color) + dither(px) / 255.0;
#ifdef SMOOTHED
    out_display = encode_rgba8(vec4(code, luminance(code)));
#else
    // Rounded as above: smoothing leaves what has no edges as it is, to the last bit, whatever the hardware does with a half
    out_display = vec4(floor(clamp(code, 0.0, 1.0) * 255.0 + 0.5) * (1.0 / 255.0), 1.0);
#endif
}
