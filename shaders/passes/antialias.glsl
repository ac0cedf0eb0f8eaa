// Smooths the steps of edges in the finished picture. An edge is followed along its row or column to both of its ends;
// from their places comes how much of a pixel lies beyond the line that the steps stand for (Reshetov 2009; Lottes 2009).
#include "lib/color.glsl"

// Contrast of the brightness, in code values from 0 to 1, from which on something is an edge, and the same as a share of the
// brightest.
const float LEAST_CONTRAST = 0.03, CONTRAST_SHARE = 0.1;
// Pixels up to which an edge is followed to either side.
const int FARTHEST = 24;
// How much of its neighbour at the most a pixel gets that stands out from all that is around it: things thinner than a pixel
// are steps without an edge.
const float LONELY_SHARE = 0.5;

uint texel_at(ivec2 at) { return load_aliased(clamp(at, ivec2(0), size_aliased() - 1)); }
float brightness_of(uint texel) { return float(int(texel >> 24u)) * (1.0 / 255.0); }
float brightness_at(ivec2 at) { return brightness_of(texel_at(at)); }
vec3 color_of(uint texel) { return vec3(ivec3(uvec3(texel, texel >> 8u, texel >> 16u) & 255u)) * (1.0 / 255.0); }

// What the mean of a pixel and the one across differs by from that of the edge.
float over_at(ivec2 at, ivec2 across, float mean) { return 0.5 * (brightness_at(at) + brightness_at(at + across)) - mean; }

// Pixels along an edge until it ends, FARTHEST if it does not; looked for in growing steps. over: see `over_at`, where it ends.
int pixels_to_end(ivec2 px, ivec2 along, ivec2 across, float mean, float limit, out float over) {
    int i = 0;
    do {
        i += i < 4 ? 1 : i < 12 ? 2 : 4;
        over = over_at(px + along * i, across, mean);
    } while (abs(over) < limit && i < FARTHEST);
    // Back to where it ended within the last step: the parity of steps must not decide which end is nearer
    for (int back = 2; back > 0; --back) {
        int before = i - back;
        float there = over_at(px + along * before, across, mean);
        if (before > 4 && abs(there) >= limit) {
            i = before;
            over = there;
        }
    }
    return i;
}

void shade(ivec2 px) {
    uint own = load_aliased(px);
    out_display = vec4(color_of(own), 1.0);
    float c = brightness_of(own);
    float w = brightness_at(px - ivec2(1, 0)), e = brightness_at(px + ivec2(1, 0));
    float s = brightness_at(px - ivec2(0, 1)), n = brightness_at(px + ivec2(0, 1));
    float low = min(c, min(min(w, e), min(s, n))), high = max(c, max(max(w, e), max(s, n)));
    float contrast = high - low;
    if (contrast < max(LEAST_CONTRAST, CONTRAST_SHARE * high)) return;

    float sw = brightness_at(px - 1), ne = brightness_at(px + 1);
    float nw = brightness_at(px + ivec2(-1, 1)), se = brightness_at(px + ivec2(1, -1));
    float changes_down = 2.0 * abs(n + s - 2.0 * c) + abs(ne + se - 2.0 * e) + abs(nw + sw - 2.0 * w);
    float changes_across = 2.0 * abs(e + w - 2.0 * c) + abs(ne + nw - 2.0 * n) + abs(se + sw - 2.0 * s);
    bool lies = changes_down >= changes_across;
    float before = lies ? s : w, after = lies ? n : e;
    bool is_after = abs(after - c) > abs(before - c);
    float beyond = is_after ? after : before;
    ivec2 along = lies ? ivec2(1, 0) : ivec2(0, 1), across = (lies ? ivec2(0, 1) : ivec2(1, 0)) * (is_after ? 1 : -1);
    float mean = 0.5 * (c + beyond), limit = 0.25 * abs(beyond - c);
    float first_over, last_over;
    int to_first = pixels_to_end(px, -along, across, mean, limit, first_over);
    int to_last = pixels_to_end(px, along, across, mean, limit, last_over);
    float end_over = to_first < to_last ? first_over : last_over;
    float share = 0.5 - (float(min(to_first, to_last)) - 0.5) / float(to_first + to_last - 1);
    // The line crosses into this side of the edge only towards that end at which this side goes on beyond
    if ((end_over < 0.0) == (c < mean)) share = 0.0;
    float around = (2.0 * (n + s + w + e) + ne + nw + se + sw) / 12.0;
    float lonely = smoothstep(0.0, 1.0, clamp(abs(around - c) / contrast, 0.0, 1.0));
    share = max(share, lonely * lonely * LONELY_SHARE);
    if (share <= 0.0) return;
    // Light adds up, codes do not
    vec3 mixed = mix(linear_from_srgb(color_of(own)), linear_from_srgb(color_of(texel_at(px + across))), share);
    out_display = vec4(srgb_from_linear(mixed), 1.0);
}
