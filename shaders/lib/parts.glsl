// Work of one texel that PARTS threads of a group share; each has its own `part` (gpu/screen_program.py).
#ifndef PARTS
#define PARTS 1
const int part = 0;
#endif

struct PartSum {
    vec4 a, b, c;
};

#if PARTS > 1
shared vec4 part_sums[3 * (PARTS - 1) * GROUP_THREADS];

// The sum over all threads of a texel, for the first of them; every thread of the group calls it.
PartSum sum_of_parts(PartSum sum) {
    int place = 3 * (int(gl_LocalInvocationIndex) - GROUP_THREADS);
    barrier();      // until an earlier sum has been read
    if (part > 0) {
        part_sums[place] = sum.a;
        part_sums[place + 1] = sum.b;
        part_sums[place + 2] = sum.c;
    }
    barrier();
    if (part == 0)
        for (int other = 1; other < PARTS; ++other) {
            place += 3 * GROUP_THREADS;
            sum.a += part_sums[place];
            sum.b += part_sums[place + 1];
            sum.c += part_sums[place + 2];
        }
    return sum;
}
#else
PartSum sum_of_parts(PartSum sum) { return sum; }
#endif
