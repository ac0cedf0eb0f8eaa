// Pixels and view space. View space is right-handed, the camera at the origin looks down -Z.
// Pixel (x, y) of level l covers the level-0 pixels [x 2^l, (x + 1) 2^l): at odd sizes the last one of
// a row hangs over the image's edge.

// Coordinates on the plane z = 1 of a point given in level-0 pixels.
//   ray_scale: size of a level-0 pixel on that plane. ray_origin: the image's lower left corner on it.
vec2 ray_from_pixel(vec2 pixel, vec2 ray_scale, vec2 ray_origin) { return pixel * ray_scale + ray_origin; }

vec3 position_from_ray(vec2 ray, float view_depth) { return vec3(ray * view_depth, -view_depth); }

bool is_on_screen(ivec2 at, ivec2 size) { return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size)); }
