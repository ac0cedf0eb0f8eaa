// A column of voxels from four finer ones: occupied where one of them is. Beyond the edge of an odd level the last
// column counts twice, which changes nothing.

void shade(ivec2 px) {
    ivec2 last = size_finer() - 1;
    ivec2 a = min(px * 2, last), b = min(px * 2 + 1, last);
    out_voxels = load_finer(a) | load_finer(ivec2(b.x, a.y)) | load_finer(ivec2(a.x, b.y)) | load_finer(b);
#ifdef HAS_FINER_FAR
    out_voxels_far = load_finer_far(a) | load_finer_far(ivec2(b.x, a.y)) | load_finer_far(ivec2(a.x, b.y))
                   | load_finer_far(b);
#endif
}
