// The irradiance that the sums amount to so far, times the material's occlusion map, as the renderer's own is.
//   first: pixel where the image begins in what was rendered; slices: of all senders.
void shade(ivec2 px) {
    out_reference = vec4(0.0);
    ivec2 at = px - first;
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size_sum()))) return;
    vec4 stored = load_sum(at);
    vec3 sum = stored.rgb - load_lost(at).rgb;
#ifdef HAS_HIDDEN
    sum -= load_hidden(at).rgb - load_hidden_lost(at).rgb;
#endif
    out_reference = vec4(sum * (slices / max(stored.a, 1.0) * load_albedo(px).a), 1.0);
}
