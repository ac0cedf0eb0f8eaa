// The decoded value of any target format as four floats.
vec4 as_vec4(vec4 v) { return v; }
vec4 as_vec4(vec3 v) { return vec4(v, 1.0); }
vec4 as_vec4(vec2 v) { return vec4(v, 0.0, 0.0); }
vec4 as_vec4(uint v) { return vec4(vec3(float(v)), 1.0); }
vec4 as_vec4(Lobe l) { return vec4(l.flux, l.back); }
vec4 as_vec4(Reflection r) { return vec4(r.radiance, r.roughness); }
vec4 as_vec4(Surface s) { return vec4(s.normal, s.view_depth); }
// Motion, whose last component is the triangle's normal.
vec4 as_vec4(vec4 motion, Surface s, int slice) {
    return vec4(s.view_depth > 0.0 ? decode_direction16(motion.w) : vec3(0.0), s.view_depth);
}
// A column of voxels, 128 slices each: the share of occupied ones, and in the last component whether `slice` is.
uint count_bits(uint v) {
    v -= (v >> 1) & 0x55555555u;
    v = (v & 0x33333333u) + ((v >> 2) & 0x33333333u);
    return (((v + (v >> 4)) & 0x0F0F0F0Fu) * 0x01010101u) >> 24;
}
uint count_bits(uvec4 v) { return count_bits(v.x) + count_bits(v.y) + count_bits(v.z) + count_bits(v.w); }
uint bit_of(uvec4 v, int slice) { return slice < 128 ? (v[slice >> 5] >> (slice & 31)) & 1u : 0u; }
vec4 as_vec4(uvec4 v, int slice) { return vec4(vec3(count_bits(v)) / 128.0, bit_of(v, slice)); }
vec4 as_vec4(uvec4 v, uvec4 more, int slice) {
    return vec4(vec3(count_bits(v) + count_bits(more)) / 256.0, slice < 128 ? bit_of(v, slice) : bit_of(more, slice - 128));
}
