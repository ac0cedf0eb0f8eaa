// Textures of materials, in fragment shaders (they need derivatives).

#ifdef SAMPLER_EXTRAS
float wrap_coordinate(int mode, float u) {
    if (mode == 1) return clamp(u, 0.0, 1.0);
    if (mode == 2) return 1.0 - abs(mod(u, 2.0) - 1.0);
    return u;
}
#endif

// A material's texture. slot: 0 base color, 1 metallic-roughness, 2 normal, 3 occlusion, 4 emission.
// SAMPLER_EXTRAS: the material has a UV transform, a second UV set, a wrap mode other than repeat or nearest
// filtering; texel 6 + 2 slot of its row holds the 2x2 matrix, the next one the offset, UV set + 2 * nearest,
// and wrap_u + 3 * wrap_v (0 repeat, 1 clamp, 2 mirror). Sampler state cannot tell, layers share it.
vec4 sample_map(sampler2DArray map, float layer, int slot, vec4 uv, sampler2D materials, int row) {
#ifdef SAMPLER_EXTRAS
    vec4 matrix = texelFetch(materials, ivec2(6 + slot * 2, row), 0);
    vec4 rest = texelFetch(materials, ivec2(7 + slot * 2, row), 0);
    int flags = int(rest.z), wrap = int(rest.w);
    vec2 at = mat2(matrix.xy, matrix.zw) * ((flags & 1) == 1 ? uv.zw : uv.xy) + rest.xy;
    vec2 dx = dFdx(at), dy = dFdy(at);      // before wrapping, which jumps
    at = vec2(wrap_coordinate(wrap % 3, at.x), wrap_coordinate(wrap / 3, at.y));
    // Linear filtering must not reach around the edge of a texture that does not repeat.
    vec2 size = vec2(textureSize(map, 0).xy), inset = 0.5 / size;
    if (wrap % 3 != 0) at.x = clamp(at.x, inset.x, 1.0 - inset.x);
    if (wrap / 3 != 0) at.y = clamp(at.y, inset.y, 1.0 - inset.y);
    if ((flags & 2) != 0) at = (floor(at * size) + 0.5) / size;
    return textureGrad(map, vec3(at, layer), dx, dy);
#else
    return texture(map, vec3(uv.xy, layer));
#endif
}
