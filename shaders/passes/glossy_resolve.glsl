// Reflected radiance of the image in this frame alone.
#include "passes/glossy_to_image.glsl"

void shade(ivec2 px) {
    out_reflection_now = vec3(0.0);
    Surface surface = load_surface(px);
    vec4 specular = load_specular(px);
    if (surface.view_depth > 0.0 && is_reflecting(specular))
        out_reflection_now = reflection_at(px, surface, specular.a).radiance;
}
