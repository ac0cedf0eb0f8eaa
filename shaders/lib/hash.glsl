// Random numbers without state (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering": pcg).

uint hash(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

// Cheaper; its upper bits are random enough for a few draws after a hash (Knuth's and Lewis's generator).
uint next_random(uint x) { return x * 1664525u + 1013904223u; }

// In [0, 1), from the upper 24 bits.
float unit_float(uint bits) { return float(bits >> 8) * (1.0 / 16777216.0); }
