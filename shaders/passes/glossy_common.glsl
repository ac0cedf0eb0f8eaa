// How far neighbours may lend a receiver their reflection. Included by the passes that filter it.
#include "lib/bilateral.glsl"
#include "lib/luminance.glsl"

// Difference of perceptual roughness at which it is halved: materials stay apart.
const float ROUGHNESS_TOLERANCE = 0.05;

// A receiver of reflections.
struct Reflector {
    Plane plane;
    Slant slant;        // over the level of the taps
    float roughness;
    float sharpness;    // of the weight by normals: an eighth of its power
};

// px: the texel around it, at the level of the taps. scale: size of a texel there on the plane z = 1.
// Tighter in normal than for irradiance: a mirror direction turns twice as far as its normal. The narrower the lobe, the
// tighter, down to cos^52, which halves a weight at 9 degrees; with less, curved surfaces would not be denoised at all.
Reflector make_reflector(Surface surface, Plane plane, float roughness, ivec2 px, vec2 scale) {
    return Reflector(plane, slant(surface.normal, px, scale), roughness,
                     mix(6.5, 1.63, clamp(roughness * 2.0, 0.0, 1.0)));
}

// apart: texels from px.
float reflection_agreement(Reflector receiver, Surface tap, float tap_roughness, vec2 apart) {
    // cos^n near 1, without logarithm and exponential
    float facing = max(1.0 + (dot(receiver.plane.normal, tap.normal) - 1.0) * receiver.sharpness, 0.0);
    facing *= facing;
    facing *= facing;
    facing *= facing;
    float off_plane = plane_distance(receiver.plane, receiver.slant, tap, apart);
    float unlike = (tap_roughness - receiver.roughness) * (1.0 / ROUGHNESS_TOLERANCE);
    float weight = facing / ((1.0 + off_plane * off_plane) * (1.0 + unlike * unlike));
    return tap.view_depth > 0.0 && tap_roughness >= 0.0 ? weight : 0.0;
}

// Sums over reflections.
struct ReflectionSum {
    vec3 radiance;
    float squares;      // of luminance
    float total;        // of the weights
};

void add_reflection(inout ReflectionSum sum, Reflection tap, float weight) {
    float light = luminance(tap.radiance);
    sum.radiance += tap.radiance * weight;
    sum.squares += light * light * weight;
    sum.total += weight;
}

// For `made_up`: distance in depth of a tap to a receiver; farther than any if nothing reflects there.
float apart_in_depth(Surface tap, Reflection reflection, Surface receiver) {
    return reflection.roughness >= 0.0 ? abs(tap.view_depth - receiver.view_depth) : 1e30;
}

// The mean of three taps, and of their spreads.
Reflection mean_reflection(Reflection taps[3], vec3 weights, float roughness) {
    vec3 sum = vec3(0.0);
    float deviation = 0.0;
    for (int i = 0; i < 3; ++i) {
        vec3 share = taps[i].radiance * weights[i];
        sum += share;
        deviation += luminance(share) * taps[i].spread;
    }
    return Reflection(sum / (weights.x + weights.y + weights.z), roughness, deviation / max(luminance(sum), 1e-12));
}

// The mean with the spread of what it was taken of, the receiver itself among it, which agrees.
Reflection measured_reflection(ReflectionSum sum, float roughness) {
    vec3 mean = sum.radiance / sum.total;
    float light = luminance(mean);
    float variance = sum.squares / sum.total - light * light;
    return Reflection(mean, roughness, sqrt(max(variance, 0.0)) / max(light, 1e-12));
}
