// Encodings of render targets. Each has a numpy twin in the tests, none in the program: what the CPU
// reads was decoded here.

// A visible surface as the pyramid stores it. view_depth: metres along -Z, 0 = background.
// normal: view space, unit length, facing the camera. whole: square of the share of the texel's
// footprint that it has: 1, or less on coarse levels.
struct Surface {
    float view_depth;
    vec3 normal;
    float whole;
};

// RGB with a shared exponent, 9 bits each and 5 for the exponent (the layout of GL_RGB9_E5, which
// cannot be rendered to). Relative error of the largest channel: at most 2^-9. Range: 0 to 65408.
uint encode_rgb9e5(vec3 color) {
    const float LARGEST = 65408.0;
    // The comparison is false for NaN, which so becomes 0 instead of spreading.
    vec3 c = vec3(color.r > 0.0 ? min(color.r, LARGEST) : 0.0,
                  color.g > 0.0 ? min(color.g, LARGEST) : 0.0,
                  color.b > 0.0 ? min(color.b, LARGEST) : 0.0);
    float largest = max(max(c.r, c.g), c.b);
    int exponent = max(-16, int(floatBitsToUint(largest) >> 23) - 127) + 16;
    float scale = uintBitsToFloat(uint(127 + 24 - exponent) << 23);   // 2^(9 + 15 - exponent)
    if (int(largest * scale + 0.5) == 512) {
        scale *= 0.5;
        exponent += 1;
    }
    uvec3 mantissa = uvec3(ivec3(c * scale + 0.5));     // CPUs convert to signed integers only
    return mantissa.r | (mantissa.g << 9) | (mantissa.b << 18) | (uint(exponent) << 27);
}

vec3 decode_rgb9e5(uint bits) {
    float scale = uintBitsToFloat(((bits >> 27) + 103u) << 23);       // 2^(exponent - 24)
    return vec3(float(bits & 511u), float((bits >> 9) & 511u), float((bits >> 18) & 511u)) * scale;
}

// Three signed components of 10 bits in the low 30 bits; error below 0.001 per component.
uint encode_snorm10(vec3 v) {
    ivec3 n = ivec3(floor(clamp(v, -1.0, 1.0) * 511.0 + 0.5)) & 1023;
    return uint(n.x | (n.y << 10) | (n.z << 20));
}

vec3 decode_snorm10(uint bits) {
    int n = int(bits);      // each in the upper ten bits: without a shift back down
    return vec3(ivec3(n << 22, n << 12, n << 2) & ~0x3FFFFF) * (1.0 / (511.0 * 4194304.0));
}

// Depth as its 32 bits, the normal as three 10-bit signed components: decoding needs no square root,
// which the gather would pay per sample. Angular error below 0.08 degrees. `whole` has the two bits that are left: thirds.
uvec2 encode_surface(Surface surface) {
    uint thirds = uint(int(clamp(surface.whole, 0.0, 1.0) * 3.0 + 0.5));
    return uvec2(floatBitsToUint(surface.view_depth), encode_snorm10(surface.normal) | (thirds << 30));
}

Surface decode_surface(uvec2 bits) {
    return Surface(uintBitsToFloat(bits.x), decode_snorm10(bits.y), float(int(bits.y >> 30)) * (1.0 / 3.0));
}

// A unit vector as one number that a half float holds exactly, whatever its stored bits are rounded by: 247x247 places of
// an octahedron (Cigolle et al. 2014) as the sign, the exponents 1 to 30 and the mantissa. Error below 1 degree, 0.35 on average.
const float OCTAHEDRON_SIDE = 247.0;

float encode_direction16(vec3 v) {
    vec2 folded = v.xy / max(abs(v.x) + abs(v.y) + abs(v.z), 1e-30);
    if (v.z < 0.0) folded = (1.0 - abs(folded.yx)) * vec2(folded.x < 0.0 ? -1.0 : 1.0, folded.y < 0.0 ? -1.0 : 1.0);
    uvec2 place = uvec2(clamp((folded * 0.5 + 0.5) * (OCTAHEDRON_SIDE - 1.0) + 0.5, 0.0, OCTAHEDRON_SIDE - 1.0));
    uint code = place.x + place.y * uint(OCTAHEDRON_SIDE);
    uint negative = code >= 30720u ? 1u : 0u;
    uint bits = code - negative * 30720u + 1024u;   // exponent and mantissa of a normal half float
    return uintBitsToFloat((negative << 31) | (((bits >> 10) + 112u) << 23) | ((bits & 1023u) << 13));
}

vec3 decode_direction16(float value) {
    uint bits = floatBitsToUint(value);
    uint code = ((((bits >> 23) & 255u) - 112u) << 10 | ((bits >> 13) & 1023u)) - 1024u + (bits >> 31) * 30720u;
    uint side = uint(OCTAHEDRON_SIDE);
    vec2 folded = vec2(code % side, code / side) * (2.0 / (OCTAHEDRON_SIDE - 1.0)) - 1.0;
    vec3 v = vec3(folded, 1.0 - abs(folded.x) - abs(folded.y));
    if (v.z < 0.0) v.xy = (1.0 - abs(v.yx)) * vec2(v.x < 0.0 ? -1.0 : 1.0, v.y < 0.0 ? -1.0 : 1.0);
    return normalize(v);
}

// Light that arrives at a point, independent of the normal there. lib/lobe.glsl gives it a meaning.
// direction: mean direction of arrival in view space, shorter than 1 the more the light spreads.
// back: light on the other side of the surface, relative to flux.
struct Lobe {
    vec3 flux;
    vec3 direction;
    float back;
};

// Direction in 8 bits per component, back / (1 + back) in the last 8: 0 and the ratios around 1 are exact enough.
vec3 quantize_lobe_direction(vec3 direction) { return floor(clamp(direction, -1.0, 1.0) * 127.0 + 0.5) / 127.0; }

uvec2 encode_lobe(Lobe lobe) {
    ivec3 d = ivec3(floor(clamp(lobe.direction, -1.0, 1.0) * 127.0 + 0.5)) & 255;
    uint back = uint(int(clamp(lobe.back / (1.0 + lobe.back), 0.0, 1.0) * 255.0 + 0.5));
    return uvec2(encode_rgb9e5(lobe.flux), uint(d.x | (d.y << 8) | (d.z << 16)) | (back << 24));
}

Lobe decode_lobe(uvec2 bits) {
    int d = int(bits.y);
    vec3 direction = vec3(ivec3(d << 24, d << 16, d << 8) & ~0xFFFFFF) * (1.0 / (127.0 * 16777216.0));
    float back = float(bits.y >> 24) * (1.0 / 255.0);
    return Lobe(decode_rgb9e5(bits.x), direction, back / max(1.0 - back, 1.0 / 255.0));
}

// Reflected radiance for a reflectance of 1. roughness: perceptual, of the surface; negative where nothing reflects.
// spread: standard deviation of what the texels around it gathered, relative to the radiance; up to 4.
struct Reflection {
    vec3 radiance;
    float roughness;
    float spread;
};

uvec2 encode_reflection(Reflection r) {
    uint roughness = r.roughness < 0.0 ? 0u : 1u + uint(int(min(r.roughness, 1.0) * 65534.0 + 0.5));
    return uvec2(encode_rgb9e5(r.radiance), roughness | uint(int(clamp(r.spread * 0.25, 0.0, 1.0) * 65535.0 + 0.5)) << 16);
}

Reflection decode_reflection(uvec2 bits) {
    return Reflection(decode_rgb9e5(bits.x), (float(bits.y & 65535u) - 1.0) * (1.0 / 65534.0),
                      float(bits.y >> 16) * (4.0 / 65535.0));
}

// What half floats hold. Overflow would be infinity on some hardware and the largest number on other; NaN fails the
// comparison and becomes 0. For values that cannot be negative.
vec3 finite_half(vec3 c) {
    const float LARGEST = 65504.0;
    return vec3(c.r > 0.0 ? min(c.r, LARGEST) : 0.0, c.g > 0.0 ? min(c.g, LARGEST) : 0.0,
                c.b > 0.0 ? min(c.b, LARGEST) : 0.0);
}

// Four numbers from 0 to 1 as the bytes of GL_RGBA8.
uint encode_rgba8(vec4 value) {
    uvec4 bytes = uvec4(ivec4(clamp(value, 0.0, 1.0) * 255.0 + 0.5));
    return bytes.r | bytes.g << 8 | bytes.b << 16 | bytes.a << 24;
}

// Reflectance in 8 bits: the square root spends the codes where the eye needs them, and 0.0019 is not 0.
vec4 encode_reflectance(vec4 value) { return vec4(sqrt(clamp(value.rgb, 0.0, 1.0)), value.a); }
vec4 decode_reflectance(vec4 value) { return vec4(value.rgb * value.rgb, value.a); }
