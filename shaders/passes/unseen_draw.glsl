// One sender among the unseen surfels, drawn in proportion to its light: systematic samples of the sum, walked down the
// pyramid of sums.
#include "lib/hash.glsl"

// One step down: which quarter `left` of the sum falls into. What rounding leaves over goes to the last one, which may
// be dark: such a sender brings nothing.
void descend(vec4 sums, inout ivec2 at, inout float left) {
    int quarter = 0;
    // `left -= sums[quarter++]` is beyond NVIDIA's compiler (580.159): it subtracts another one
    for (; quarter < 3; ++quarter) {
        float part = sums[quarter];
        if (left < part) break;
        left -= part;
    }
    at = 2 * at + ivec2(quarter & 1, quarter >> 1);
}

void shade(ivec2 px) {
    out_unseen_position = out_unseen_power = vec4(0.0);
    vec4 top = load_sums_9(ivec2(0));
    float total = dot(top, vec4(1.0)), count = float(side * side);
    if (total <= 0.0) return;
    int index = px.x + px.y * side;
    float jitter = unit_float(hash(uint(index) ^ hash(uint(random_seed))));
    float left = (float(index) + jitter) / count * total;
    ivec2 at = ivec2(0);
    descend(top, at, left);
    descend(load_sums_8(at), at, left);
    descend(load_sums_7(at), at, left);
    descend(load_sums_6(at), at, left);
    descend(load_sums_5(at), at, left);
    descend(load_sums_4(at), at, left);
    descend(load_sums_3(at), at, left);
    descend(load_sums_2(at), at, left);
    descend(load_sums_1(at), at, left);
    vec4 radiance = load_radiance(at), place = texelFetch(texture_surfel_position, at, 0);
    if (radiance.a <= 0.0) return;
    vec3 normal = mat3(frame.view_from_world) * texelFetch(texture_surfel_normal, at, 0).xyz;
    out_unseen_position = vec4((frame.view_from_world * vec4(place.xyz, 1.0)).xyz, 0.0);
    // Area over (count times probability), where the probability is the share of the sum
    out_unseen_power = vec4(radiance.rgb * (place.w * total / (count * radiance.a)), encode_direction16(normal));
}
