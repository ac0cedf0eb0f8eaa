// The finished picture, stretched over a framebuffer.
uniform sampler2D picture;
uniform ivec2 target_size;
out vec4 color;

void main() {
    ivec2 size = textureSize(picture, 0);
    color = texelFetch(picture, min(ivec2(gl_FragCoord.xy / vec2(target_size) * vec2(size)), size - 1), 0);
}
