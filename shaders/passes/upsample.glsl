// Irradiance of one level: the level's own gather, denoised, plus the sum of all coarser levels brought up by
// two. Both filters are cross-bilateral: a tap counts by its kernel weight, the agreement of normals and its
// distance to the receiver's tangent plane. UPSAMPLING: 0 bilateral, 1 nearest.

#include "lib/bilateral.glsl"
#include "lib/lobe.glsl"
#include "lib/parts.glsl"

// Sums over lobes, evaluated for the receiver at hand.
struct Sum {
    vec3 irradiance;
    vec3 back;
    vec3 direction;     // times flux
    float flux;
};

void add(inout Sum sum, Lobe lobe, vec3 lobe_normal, vec3 normal, float weight) {
    float flux = lobe_weight(lobe.flux) * weight;
    sum.irradiance += lobe_irradiance(lobe, lobe_normal, normal) * weight;
    sum.back += lobe.flux * (lobe.back * weight);
    sum.direction += lobe.direction * flux;
    sum.flux += flux;
}

Sum scaled(Sum sum, float s) { return Sum(sum.irradiance * s, sum.back * s, sum.direction * s, sum.flux * s); }

Sum plus(Sum a, Sum b) {
    return Sum(a.irradiance + b.irradiance, a.back + b.back, a.direction + b.direction, a.flux + b.flux);
}

const Sum NO_LIGHT = Sum(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);

#ifdef HAS_GATHER
// Sum over the texels of a window, and of their weights: the gather's rotations repeat every 4 texels. Threads that
// share a texel take a row each.
void add_window(ivec2 px, Surface receiver, Plane plane, inout Sum sum, inout float total) {
    ivec2 last = size_gather() - 1;
    Slant slanted = slant(receiver.normal, px, frame.ray_scale * texel);
    int row = part;
    do {
        for (int column = 0; column < 4; ++column) {
            ivec2 at = window_tap(px, column, row, last);
            Surface tap = load_surface(at);
            float weight = agreement(plane, slanted, tap, vec2(at - px));
            add(sum, load_gather(at), tap.normal, receiver.normal, weight);
            total += weight;
        }
    } while ((row += PARTS) < WINDOW_ROWS);
}

// The level's own light, for the first of the threads that share a texel. Every thread calls it.
Sum denoised(ivec2 px, Surface receiver, Plane plane) {
    Sum sum = NO_LIGHT;
#if UPSAMPLING == 1
    add(sum, load_gather(px), receiver.normal, receiver.normal, 1.0);
#else
    float total = 0.0;
    if (receiver.view_depth > 0.0) add_window(px, receiver, plane, sum, total);
    PartSum all = sum_of_parts(PartSum(vec4(sum.irradiance, sum.flux), vec4(sum.back, total), vec4(sum.direction, 0.0)));
    sum = scaled(Sum(all.a.rgb, all.b.rgb, all.c.rgb, all.a.a), 1.0 / max(all.b.a, 1e-6));
#endif
    // Light from close by changes from texel to texel, most of all where surfaces meet: it is left as it is.
    add(sum, load_near(px), receiver.normal, receiver.normal, 1.0);
    return sum;
}
#endif

#ifdef HAS_COARSE
#ifdef BLOCK
// What the texels of a block of 2x2 share: the coarse texel around them, and those on its left, right, below and above.
struct CoarseTap {
    Surface surface;
    Lobe light;
};
CoarseTap block_taps[5];

#define LOAD_BLOCK load_block
void load_block(ivec2 first) {
    ivec2 own = first / 2, last = size_coarse() - 1;
    for (int i = 0; i < 5; ++i) {
        ivec2 at = clamp(own + ivec2(int(i == 2) - int(i == 1), int(i == 4) - int(i == 3)), ivec2(0), last);
        block_taps[i] = CoarseTap(load_coarse_surface(at), load_coarse(at));
    }
}

// 0: the coarse texel around the texel at hand. 1, 2: the nearest one along x and y, on the side of its corner of the block.
// Both sides are named: for an index that the compiler does not know, arrays would be kept in memory.
CoarseTap tap_of_corner(int i) {
    if (i == 0) return block_taps[0];
    CoarseTap tap = block_taps[2 * i - 1];
    if ((i == 1 ? corner.x : corner.y) == 1) tap = block_taps[2 * i];
    return tap;
}

Surface tap_surface(int i, ivec2 at) { return tap_of_corner(i).surface; }
Lobe tap_lobe(int i, ivec2 at) { return tap_of_corner(i).light; }
#else
Surface tap_surface(int i, ivec2 at) { return load_coarse_surface(at); }
Lobe tap_lobe(int i, ivec2 at) { return load_coarse(at); }
#endif

Sum from_coarser(ivec2 px, Surface receiver, Plane plane) {
    ivec2 last = size_coarse() - 1;
#if UPSAMPLING == 1
    Sum sum = NO_LIGHT;
    ivec2 at = min(px / 2, last);
    add(sum, load_coarse(at), load_coarse_surface(at).normal, receiver.normal, 1.0);
    return sum;
#else
    // The pixel's own coarse texel and the nearest ones along either axis. Weights of 1/2 and 1/4 reproduce what is
    // linear over the image, like the four of a bilinear filter.
    ivec2 own = px / 2;
    ivec2 next = clamp(own + (px & 1) * 2 - 1, ivec2(0), last);
    Slant slanted = slant(receiver.normal, own, frame.ray_scale * (texel * 2.0));
    ivec2 taps[3] = ivec2[](own, ivec2(next.x, own.y), ivec2(own.x, next.y));
    vec3 normals[3], weights, apart;
    for (int i = 0; i < 3; ++i) {
        Surface tap = tap_surface(i, taps[i]);
        normals[i] = tap.normal;
        weights[i] = (i == 0 ? 0.5 : 0.25) * agreement(plane, slanted, tap, vec2(taps[i] - own));
#ifndef HAS_GATHER      // between levels that gather, it would cost light: the errors of cornell and arch grew by 4 %
        weights[i] *= wholeness(tap);
#endif
        apart[i] = apart_in_depth(tap, receiver);
    }
    weights = made_up(weights, apart);
    Sum sum = NO_LIGHT;
    for (int i = 0; i < 3; ++i) add(sum, tap_lobe(i, taps[i]), normals[i], receiver.normal, weights[i]);
    return scaled(sum, 1.0 / (weights.x + weights.y + weights.z));
#endif
}
#endif

void shade(ivec2 px) {
    Sum light = NO_LIGHT;
    Surface receiver = load_surface(px);
    Plane plane = tangent_plane(receiver, ray_from_pixel(vec2(px) + 0.5, frame.ray_scale * texel, frame.ray_origin));
#ifdef HAS_GATHER
    light = denoised(px, receiver, plane);
#endif
#if PARTS > 1
    if (part > 0) return;
#endif
    if (receiver.view_depth <= 0.0) light = NO_LIGHT;
#ifdef HAS_COARSE
    else if (!is_coarsest) light = plus(light, from_coarser(px, receiver, plane));
#endif
#ifdef IMAGE_LEVEL
    vec3 irradiance = light.irradiance;
#ifdef HAS_ALBEDO
    irradiance *= load_albedo(px).a;    // the material's occlusion map: indirect light only (glTF 2.0, 3.9.3)
#endif
    out_upsample = irradiance;
#else
    out_light = make_lobe(light.irradiance, light.back, light.direction, light.flux, receiver.normal);
#endif
}
