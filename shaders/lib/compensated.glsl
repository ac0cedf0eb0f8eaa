// Sums of many single-precision numbers without drift (Kahan 1965). `lost` is what rounding added to `sum` so far; the
// pair goes on from one call to the next. `one` is 1, from a uniform: a compiler that knew it would take (a + b) - a for b,
// which GLSL 3.30 has no word against. Mesa does.
#if __VERSION__ >= 400
#define EXACT precise
#else
#define EXACT
#endif

void add_compensated(inout vec3 sum, inout vec3 lost, vec3 value, float one) {
    EXACT vec3 addend = value - lost;
    EXACT vec3 grown = (sum + addend) * one;
    EXACT vec3 taken = grown * one - sum;
    EXACT vec3 rest = taken * one - addend;
    sum = grown;
    lost = rest;
}
