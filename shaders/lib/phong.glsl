// The glossy lobe: Phong's, cos^e of the angle to the mirror direction, normalized over the hemisphere.
#include "lib/pi.glsl"

const float LEAST_EXPONENT = 1.0;       // a wider lobe than that is no longer told from a diffuse one
const float LARGEST_EXPONENT = 10000.0; // half a degree: stored normals are not much more exact

// Exponent of the lobe that matches the GGX lobe of a perceptual roughness: alpha = roughness^2 (Burley 2012), cosine of
// the half vector to the power 2 / alpha^2 - 2 (Walter et al. 2007), and a quarter of that for the angle to the mirror
// direction, which is twice the half vector's (Fisher and Woo 1994).
float phong_exponent(float roughness) {
    float alpha = roughness * roughness;
    return clamp(0.5 / max(alpha * alpha, 1e-8) - 0.5, LEAST_EXPONENT, LARGEST_EXPONENT);
}

// What the exponent is multiplied by where a lobe is blurred over a disc of the squared angular radius above / below (its
// tangent's): variances add, about 1 / e of the lobe along each axis, a quarter of the squared radius of the disc. below > 0.
float narrowing_by_disc(float exponent, float above, float below) { return below / (below + 0.25 * exponent * above); }

// (e + 2) / (2 pi) cos^e, sr^-1; lobe_cos > 0.
float phong_lobe(float exponent, float lobe_cos) {
    return (exponent + 2.0) / (2.0 * PI) * pow(lobe_cos, exponent);
}

// The integral of phong_lobe times the receiver's cosine over the hemisphere around the normal: 1 for a mirror direction
// along the normal, less for one that is n_dot_r from it. Divided by it, uniform surroundings are reflected as they are.
//
// Derived in polar coordinates around the axis that is perpendicular to both, where the integral separates:
//   (1 - c^2)^(e/2 + 1) / ((e + 1) W) + c (1/2 + integral of cos^(e + 1) from 0 to asin c / W),
// W the integral of cos^(e + 1) from -pi/2 to pi/2. W and the rest have approximations that are within 1.6 % together.
float phong_albedo(float exponent, float n_dot_r) {
    float c = clamp(n_dot_r, 0.0, 1.0), k = exponent + 1.0;
    float whole = sqrt(2.0 * PI / (k + 0.5 + 0.1366 / (1.0 + 0.93 * k)));
    float s = sqrt(0.5 * exponent + 0.75);
    vec2 x = min(vec2(c * s, s), vec2(4.0));        // both arguments of an error function, 1 beyond
    vec2 e = 1.0 - 2.0 / (exp(x * (2.2566 + 0.2018 * x * x)) + 1.0);    // tanh of half of that
    float sine = pow(max(1.0 - c * c, 1e-12), 0.5 * exponent + 1.0);
    return sine / (k * whole) + c * (0.5 + 0.5 * e.x / e.y);
}

// Share of the lobe that a cone around the mirror direction leaves out.
const float CONE_REST = 0.01;

// Cosine of the half-angle of the cone that holds the rest: cos^e = CONE_REST.
float lobe_cone_cos(float exponent) { return pow(CONE_REST, 1.0 / exponent); }
