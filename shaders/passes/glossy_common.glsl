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

// Weighted mean of reflections, and the one nearest in depth, for when nobody agrees (LEAST_AGREEMENT).
struct ReflectionSum {
    vec3 sum;
    float squares;      // of luminance
    float deviation;    // spread times luminance
    float total;
    Reflection nearest;
    float apart;
};

ReflectionSum no_reflection() {
    return ReflectionSum(vec3(0.0), 0.0, 0.0, 0.0, Reflection(vec3(0.0), 0.0, 0.0), 1e30);
}

void add_reflection(inout ReflectionSum sum, Reflection tap, float weight) {
    float light = luminance(tap.radiance);
    sum.sum += tap.radiance * weight;
    sum.squares += light * light * weight;
    sum.deviation += tap.spread * light * weight;
    sum.total += weight;
}

// apart: distance in depth.
void add_reflection(inout ReflectionSum sum, Reflection tap, float weight, float apart) {
    add_reflection(sum, tap, weight);
    if (tap.roughness >= 0.0 && apart < sum.apart) {
        sum.apart = apart;
        sum.nearest = tap;
    }
}

// The mean, with the mean of the spreads.
Reflection mean_reflection(ReflectionSum sum, float roughness) {
    float missing = max(LEAST_AGREEMENT - sum.total, 0.0);
    vec3 mean = (sum.sum + sum.nearest.radiance * missing) / (sum.total + missing);
    float deviation = (sum.deviation + sum.nearest.spread * luminance(sum.nearest.radiance) * missing)
                    / (sum.total + missing);
    return Reflection(mean, roughness, deviation / max(luminance(mean), 1e-12));
}

// The mean with the spread of what it was taken of, the receiver itself among it, which agrees.
Reflection measured_reflection(ReflectionSum sum, float roughness) {
    vec3 mean = sum.sum / sum.total;
    float light = luminance(mean);
    float variance = sum.squares / sum.total - light * light;
    return Reflection(mean, roughness, sqrt(max(variance, 0.0)) / max(light, 1e-12));
}
