// Tables of four floats a texel that functions take as an argument. Programs that read them through images say so beforehand
// (gpu/screen_program.py).
#ifndef FLOAT_TABLE
#define FLOAT_TABLE sampler2D
#define FLOAT_TEXEL(table, at) texelFetch(table, at, 0)
#endif
