// Irradiance that can be turned to another normal. A coarse texel gathers light for the one normal that it kept;
// the fine pixels that it serves have normals of their own. So what travels up the pyramid is the light before the
// cosine: a flux, its mean direction, and what arrives on the surface's other side.
#include "lib/luminance.glsl"

// Share of the flux that a receiver gets whatever its normal is. Measured: 0.1 to 0.5 differ little, 0.25 was best.
const float LOBE_AMBIENT = 0.25;
// A receiver that faces away gets a little all the same: neighbours see other senders, and black would be the worst
// guess.
const float LEAST_RESPONSE = 0.05;

// Irradiance on the gathering surface's own normal, or near it = flux * response. Linear in the direction, so that
// lobes can be added and interpolated without the sum being brighter than its parts.
float lobe_response(vec3 direction, vec3 normal) {
    return max(dot(direction, normal) + LOBE_AMBIENT, LEAST_RESPONSE);
}

float lobe_weight(vec3 flux) { return luminance(flux); }

// The lobe of a receiver: irradiance on its front and on its back, and the sum of the directions of arrival times
// their weights. The flux is the one that gives the irradiance back exactly, for the direction as it will be stored.
Lobe make_lobe(vec3 irradiance, vec3 back_irradiance, vec3 directions, float weights, vec3 normal) {
    vec3 direction = quantize_lobe_direction(weights > 0.0 ? directions / weights : normal * 0.66);
    vec3 flux = irradiance / lobe_response(direction, normal);
    // `back` is relative to the flux and its code ends at 128: a black front keeps that much of its back
    flux = max(flux, back_irradiance / 128.0);
    float weight = lobe_weight(flux);
    return Lobe(flux, direction, weight > 0.0 ? min(lobe_weight(back_irradiance) / weight, 128.0) : 0.0);
}

// Irradiance over flux of a receiver with its own normal, from a lobe gathered for another one.
float lobe_share(Lobe lobe, vec3 lobe_normal, vec3 normal) {
    float turned = 0.5 - 0.5 * dot(lobe_normal, normal);
    return lobe_response(lobe.direction, normal) + lobe.back * turned;
}

vec3 lobe_irradiance(Lobe lobe, vec3 lobe_normal, vec3 normal) {
    return lobe.flux * lobe_share(lobe, lobe_normal, normal);
}
