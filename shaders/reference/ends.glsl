// Where a ray to a sender ends: at that pixel of its texel which is nearest to the texel's centre. The centre itself is
// made up by the mipmaps and can lie inside of a wall. Alpha: 0 where the texel has no pixel with a surface.
//   first: pixel where the image begins in what was rendered; first_sender: the same in texels of the senders' level.
void shade(ivec2 px) {
    out_ends = vec4(0.0);
    ivec2 at = px + first_sender;
    vec2 ray = ray_from_pixel(vec2(at) + 0.5, frame.ray_scale * float(side), frame.ray_origin);
    vec3 center = position_from_ray(ray, load_surface(at).view_depth);
    float nearest = 1e30;
    ivec2 begin = at * side, end = min(begin + side, first + image_size);
    for (int y = begin.y; y < end.y; ++y)
        for (int x = begin.x; x < end.x; ++x) {
            float depth = load_receivers(ivec2(x, y)).view_depth;
            if (depth <= 0.0) continue;
            ray = ray_from_pixel(vec2(x, y) + 0.5, frame.ray_scale, frame.ray_origin);
            vec3 position = position_from_ray(ray, depth);
            float apart = distance(position, center);
            if (apart < nearest) {
                nearest = apart;
                out_ends = vec4(position, 1.0);
            }
        }
}
