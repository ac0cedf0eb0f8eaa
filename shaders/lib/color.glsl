// Display: linear radiance to sRGB code values.

// ACES filmic curve, Narkowicz's fit (2015), per channel.
vec3 tone_map_aces(vec3 c) {
    return clamp(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0.0, 1.0);
}

// Khronos PBR Neutral (2024): takes up to 0.04 from all channels, is the identity below 0.76 otherwise; highlights are
// compressed by their peak, then desaturated.
vec3 tone_map_neutral(vec3 c) {
    const float START = 0.8 - 0.04;
    float low = min(c.r, min(c.g, c.b));
    c -= low < 0.08 ? low - 6.25 * low * low : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < START) return max(c, 0.0);
    float d = 1.0 - START;
    float compressed = 1.0 - d * d / (peak + d - START);
    c *= compressed / peak;
    return mix(c, vec3(compressed), 1.0 - 1.0 / (0.15 * (peak - compressed) + 1.0));
}

vec3 tone_map_reinhard(vec3 c) { return c / (1.0 + c); }

// 1.055 c^(1/2.4) - 0.055 as a fraction of polynomials of c^(1/2), within 0.005 of a code value of 255: CPUs have roots, but no powers.
vec3 srgb_from_linear(vec3 c) {
    c = clamp(c, 0.0, 1.0);
    vec3 t = sqrt(c);
    vec3 curve = (((0.71879492 * t + 1.75009435) * t + 0.22243427) * t - 0.00779502) / ((t + 1.51811969) * t + 0.16536103);
    return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

// ((c + 0.055) / 1.055)^2.4 as a polynomial, within 0.013 of a code value of 255.
vec3 linear_from_srgb(vec3 c) {
    vec3 curve = ((((0.0873141 * c - 0.30745408) * c + 0.66722548) * c + 0.51935893) * c + 0.03274931) * c + 0.00091675622;
    return mix(curve, c * (1.0 / 12.92), lessThanEqual(c, vec3(0.04045)));
}
