// The texel around a place and its nearest neighbours along either axis.

struct Taps {
    ivec2 at[3];
    vec2 apart[3];      // texels from the place to their centres
    vec3 weights;       // with which they reproduce what is linear over the image; they add up to 1
};

// place: in texels.
Taps nearest_taps(vec2 place) {
    vec2 own = floor(place), f = place - own - 0.5;
    ivec2 at = ivec2(own), step = ivec2(f.x < 0.0 ? -1 : 1, f.y < 0.0 ? -1 : 1);
    vec2 aside = abs(f);
    return Taps(ivec2[](at, at + ivec2(step.x, 0), at + ivec2(0, step.y)),
                vec2[](-f, vec2(float(step.x), 0.0) - f, vec2(0.0, float(step.y)) - f),
                vec3(1.0 - aside.x - aside.y, aside));
}
