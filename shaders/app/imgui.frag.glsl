// The user interface: colours are sRGB-encoded already and go to a UNORM framebuffer as they are.
uniform sampler2D atlas;

in vec2 uv;
in vec4 color;

out vec4 out_color;

void main() {
    out_color = color * texture(atlas, uv);
}
