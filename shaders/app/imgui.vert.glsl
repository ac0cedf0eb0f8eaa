// The user interface: positions in window units, origin at the top left.
uniform vec2 display_position;
uniform vec2 display_size;

in vec2 in_position;
in vec2 in_uv;
in vec4 in_color;

out vec2 uv;
out vec4 color;

void main() {
    vec2 unit = (in_position - display_position) / display_size;
    uv = in_uv;
    color = in_color;
    gl_Position = vec4(unit.x * 2.0 - 1.0, 1.0 - unit.y * 2.0, 0.0, 1.0);
}
