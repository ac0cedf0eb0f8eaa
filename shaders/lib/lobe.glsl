#define LOBE_AMBIENT 0.25
// Irradiance that can be turned to another normal.

// Irradiance on the gathering surface's own normal, or near it = flux * response.
float lobe_response(vec3 direction, vec3 normal) {
    return max(dot(direction, normal) + LOBE_AMBIENT, 0.05);
}

float lobe_weight(vec3 flux) { return dot(flux, vec3(0.2126, 0.7152, 0.0722)); }

Lobe make_lobe(vec3 irradiance, vec3 back_irradiance, vec3 directions, float weights, vec3 normal) {
    vec3 quantized = quantize_lobe_direction(weights > 0.0 ? directions / weights : normal * 0.66);
    vec3 flux = irradiance / lobe_response(quantized, normal);
    flux = max(flux, back_irradiance / 128.0);
    float weight = lobe_weight(flux);
    return Lobe(flux, quantized, weight > 0.0 ? min(lobe_weight(back_irradiance) / weight, 128.0) : 0.0);
}

// Irradiance that a receiver with its own normal gets from a lobe gathered for another one.
vec3 lobe_irradiance(Lobe lobe, vec3 lobe_normal, vec3 normal) {
    float turned = 0.5 - 0.5 * dot(lobe_normal, normal);
    return lobe.flux * (max(dot(lobe.direction, normal) + LOBE_AMBIENT, 0.0) + lobe.back * turned);
}
