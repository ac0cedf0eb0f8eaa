#define LOBE_AMBIENT 0.25
// Irradiance that can be turned to another normal. A coarse texel gathers light for the one normal that it kept;
// the fine pixels that it serves have normals of their own. So what travels up the pyramid is the light before the
// cosine: a flux and a mean direction, the first two moments of spherical harmonics.

// Irradiance = flux * response. Linear in the direction, so that lobes can be added and interpolated without the
// sum being brighter than its parts.
float lobe_response(vec3 direction, vec3 normal) {
    return max(dot(direction, normal) + LOBE_AMBIENT, 0.05);
}

float lobe_weight(vec3 flux) { return dot(flux, vec3(0.2126, 0.7152, 0.0722)); }

// The lobe of a receiver: sum over its senders of irradiance and of unit directions weighted by `weights`.
Lobe make_lobe(vec3 irradiance, vec3 weighted_directions, float weights, vec3 normal) {
    vec3 direction = weights > 0.0 ? weighted_directions / weights : normal * 0.66;
    return Lobe(irradiance / lobe_response(direction, normal), direction);
}

// Sums of lobes are kept as flux and direction * weight, where addition is plain.
Lobe lobe_moments(Lobe lobe) { return Lobe(lobe.flux, lobe.direction * lobe_weight(lobe.flux)); }

Lobe lobe_from_moments(Lobe sum) {
    float weight = lobe_weight(sum.flux);
    return Lobe(sum.flux, weight > 0.0 ? sum.direction / weight : vec3(0.0));
}
