// Something to copy that no driver can fold into a constant.
void shade(ivec2 px) {
    out_pattern = vec4(vec2(px & 255) / 255.0, float((px.x ^ px.y) & 255) / 255.0, 1.0);
}
