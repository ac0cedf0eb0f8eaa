// Reflected radiance of one level and all coarser ones: the level's own gather, denoised over the 4x4 block in which its
// sample pattern repeats, plus the sum of the coarser levels brought up by two. UPSAMPLING: 0 bilateral, 1 nearest.
#include "passes/glossy_common.glsl"
#include "lib/parts.glsl"

// The level's own reflection, for the first of the threads that share a texel; of no use where nothing reflects. Every
// thread calls it.
Reflection denoised(ivec2 px, Surface receiver, Plane plane, Reflection own) {
#if UPSAMPLING == 1
    return own;
#else
    ReflectionSum sum = ReflectionSum(vec3(0.0), 0.0, 0.0);
    if (own.roughness >= 0.0) {
        ivec2 last = size_glossy_gather() - 1;
        Reflector reflector = make_reflector(receiver, plane, own.roughness, px, frame.ray_scale * texel);
        int row = part;
        do {
            for (int x = -2; x <= 2; ++x) {
                ivec2 at = soft_window_tap(px, x, row, last);
                Reflection tap = load_glossy_gather(at);
                Surface there = load_surface(at);
                float weight = soft_window_weight(x, row)
                             * reflection_agreement(reflector, there, tap.roughness, vec2(at - px));
                add_reflection(sum, tap, weight);
            }
        } while ((row += PARTS) < SOFT_WINDOW_ROWS);
    }
    PartSum all = sum_of_parts(PartSum(vec4(sum.radiance, sum.total), vec4(sum.squares), vec4(0.0)));
    return measured_reflection(ReflectionSum(all.a.rgb, all.b.x, all.a.a), own.roughness);
#endif
}

#ifdef HAS_COARSE
Reflection from_coarser(ivec2 px, Surface receiver, Plane plane, float roughness) {
    ivec2 last = size_coarse() - 1;
#if UPSAMPLING == 1
    return load_coarse(min(px / 2, last));
#else
    // The texel's own coarse one and the nearest along either axis, as in upsample.glsl
    ivec2 own = px / 2, next = clamp(own + (px & 1) * 2 - 1, ivec2(0), last);
    Reflector reflector = make_reflector(receiver, plane, roughness, own, frame.ray_scale * (texel * 2.0));
    ivec2 taps[3] = ivec2[](own, ivec2(next.x, own.y), ivec2(own.x, next.y));
    Reflection reflections[3];
    vec3 weights, apart;
    for (int i = 0; i < 3; ++i) {
        Surface there = load_coarse_surface(taps[i]);
        reflections[i] = load_coarse(taps[i]);
        weights[i] = (i == 0 ? 0.5 : 0.25)
                   * reflection_agreement(reflector, there, reflections[i].roughness, vec2(taps[i] - own));
        apart[i] = apart_in_depth(there, reflections[i], receiver);
    }
    return mean_reflection(reflections, made_up(weights, apart), roughness);
#endif
}
#endif

void shade(ivec2 px) {
    Reflection own = load_glossy_gather(px);
    out_glossy_light = own;
    Surface receiver = load_surface(px);
    Plane plane = tangent_plane(receiver, ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin));
    Reflection light = denoised(px, receiver, plane, own);
    if (own.roughness < 0.0) return;
#ifdef HAS_COARSE
    Reflection coarse = from_coarser(px, receiver, plane, own.roughness);
    float deviation = light.spread * luminance(light.radiance) + coarse.spread * luminance(coarse.radiance);
    light.radiance += coarse.radiance;
    light.spread = deviation / max(luminance(light.radiance), 1e-12);
#endif
    out_glossy_light = light;
}
