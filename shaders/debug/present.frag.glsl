// The finished picture, stretched over a framebuffer. is_smooth: between its texels, too.
uniform sampler2D picture;
uniform ivec2 target_origin, target_size;
uniform bool is_smooth;
out vec4 color;

vec4 texel_at(ivec2 at, ivec2 size) { return texelFetch(picture, clamp(at, ivec2(0), size - 1), 0); }

void main() {
    ivec2 size = textureSize(picture, 0);
    vec2 place = (gl_FragCoord.xy - vec2(target_origin)) / vec2(target_size) * vec2(size);
    if (!is_smooth || size == target_size) {
        color = texel_at(ivec2(place), size);
        return;
    }
    vec2 first = floor(place - 0.5), share = place - 0.5 - first;
    ivec2 at = ivec2(first);
    color = mix(mix(texel_at(at, size), texel_at(at + ivec2(1, 0), size), share.x),
                mix(texel_at(at + ivec2(0, 1), size), texel_at(at + ivec2(1, 1), size), share.x), share.y);
}
