// The decoded value of any target format as four floats.
vec4 as_vec4(vec4 v) { return v; }
vec4 as_vec4(vec3 v) { return vec4(v, 1.0); }
vec4 as_vec4(uint v) { return vec4(vec3(float(v)), 1.0); }
vec4 as_vec4(Lobe l) { return vec4(l.flux, l.back); }
vec4 as_vec4(Surface s) { return vec4(s.normal, s.view_depth); }
