// Light that arrives at a surface, summed over its senders: what `make_lobe` takes, but for a factor they may lack.
#include "lib/lobe.glsl"

struct Incoming {
    vec3 irradiance;
    vec3 back_irradiance;   // on the other side
    vec3 directions;        // sum of unit directions times weight
    float weights;
};

const Incoming NO_LIGHT = Incoming(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);

// All but the direction, whose weight it returns. light: without the cosine at the receiver, which is negative for what
// arrives at its back.
float receive(float receiver_cos, vec3 light, inout Incoming sum) {
    sum.irradiance += light * max(receiver_cos, 0.0);
    sum.back_irradiance += light * max(-receiver_cos, 0.0);
    float weight = receiver_cos > 0.0 ? lobe_weight(light) : 0.0;
    sum.weights += weight;
    return weight;
}
