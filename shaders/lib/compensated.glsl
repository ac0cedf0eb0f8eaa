// Sums of many single-precision numbers without drift (Kahan 1965). `lost` is what rounding added to `sum` so far; the
// pair goes on from one call to the next. Compilers of GLSL 3.30 cannot be told to keep the order of operations: where
// one does not, a plain sum of partial sums is what is left.
#if __VERSION__ >= 400
#define EXACT precise
#else
#define EXACT
#endif

void add_compensated(inout vec3 sum, inout vec3 lost, vec3 value) {
    EXACT vec3 addend = value - lost;
    EXACT vec3 grown = sum + addend;
    EXACT vec3 taken = grown - sum;
    EXACT vec3 rest = taken - addend;
    sum = grown;
    lost = rest;
}
