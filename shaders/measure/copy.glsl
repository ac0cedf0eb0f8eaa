// The least that a pass can do with a texel: read it and write it.
void shade(ivec2 px) {
    out_copied = load_pattern(px);
}
