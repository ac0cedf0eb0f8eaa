// The irradiance that the sums amount to so far, times the material's occlusion map, as the renderer's own is.
//   first: pixel where the image begins in what was rendered; slices: of all senders.
void shade(ivec2 px) {
    vec4 stored = load_sum(px);
    vec3 sum = stored.rgb - load_lost(px).rgb;
#ifdef HAS_HIDDEN
    sum -= load_hidden(px).rgb - load_hidden_lost(px).rgb;
#endif
    out_reference = vec4(sum * (slices / max(stored.a, 1.0) * load_albedo(px + first).a), 1.0);
}
