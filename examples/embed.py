"""Indirect light in a moderngl program of your own: python examples/embed.py

A small deferred renderer draws a room lit by one lamp into a G-buffer, hands its textures to `IndirectLighting`, gets
the irradiance texture back, and composes the picture from it. What concerns ssil_viewer is in `main`.
"""

import math

import moderngl
import numpy as np
from PIL import Image

from ssil_viewer import IndirectLighting, Settings, create_headless_context

LAMP, POWER = (0.0, 0.8, 0.3), 3.0  # position, W sr^-1
EYE, FOV, NEAR, FAR = (0.0, 0.0, 2.9), math.radians(45), 0.1, 20.0
WHITE, RED, GREEN = (0.73, 0.73, 0.73), (0.63, 0.06, 0.05), (0.14, 0.45, 0.09)
# A room of 2 m, open towards the camera, and a shelf in it: corner, two edges whose cross product is the normal, albedo
ROOM = [
    ((-1, -1, 1), (2, 0, 0), (0, 0, -2), WHITE), ((-1, 1, -1), (2, 0, 0), (0, 0, 2), WHITE),
    ((-1, -1, -1), (2, 0, 0), (0, 2, 0), WHITE), ((-1, -1, 1), (0, 0, -2), (0, 2, 0), RED),
    ((1, -1, -1), (0, 0, 2), (0, 2, 0), GREEN), ((-0.4, -0.3, 0.4), (0.8, 0, 0), (0, 0.2, -0.6), WHITE),
]

GBUFFER_VERTEX = """#version 330
uniform mat4 clip_from_view, view_from_world;
in vec3 position, normal, albedo;
out vec3 world_position, world_normal, surface_albedo;
void main() {
    world_position = position; world_normal = normal; surface_albedo = albedo;
    gl_Position = clip_from_view * view_from_world * vec4(position, 1.0);
}"""
GBUFFER_FRAGMENT = """#version 330
uniform vec3 lamp;
uniform float power;
in vec3 world_position, world_normal, surface_albedo;
layout(location = 0) out vec4 normal;
layout(location = 1) out vec4 radiance;
layout(location = 2) out vec4 albedo;
void main() {
    vec3 to_lamp = lamp - world_position;
    float irradiance = power * max(dot(world_normal, normalize(to_lamp)), 0.0) / dot(to_lamp, to_lamp);
    normal = vec4(world_normal, 0.0);
    radiance = vec4(surface_albedo * irradiance / 3.14159265, 1.0);
    albedo = vec4(surface_albedo, 1.0);
}"""
COMPOSE_VERTEX = """#version 330
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }"""
COMPOSE_FRAGMENT = """#version 330
uniform sampler2D radiance, albedo, irradiance;
out vec4 color;
void main() {
    ivec2 px = ivec2(gl_FragCoord.xy);
    vec3 indirect = texelFetch(albedo, px, 0).rgb * texelFetch(irradiance, px, 0).rgb / 3.14159265;
    vec3 light = texelFetch(radiance, px, 0).rgb + indirect;
    color = vec4(pow(light / (1.0 + light), vec3(1.0 / 2.2)), 1.0);
}"""


def room_vertices():
    """Two triangles for each quad: (N, 9) float32, position, normal, albedo."""
    rows = []
    for corner, u, v, albedo in ROOM:
        corner, u, v = (np.asarray(value, float) for value in (corner, u, v))
        normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        corners = (corner, corner + u, corner + u + v, corner, corner + u + v, corner + v)
        rows += [(*point, *normal, *albedo) for point in corners]
    return np.array(rows, np.float32)


def projection_matrix(aspect):
    """clip_from_view; matrices here multiply columns, and are transposed on their way to OpenGL."""
    y = 1 / math.tan(FOV / 2)
    return np.array([[y / aspect, 0, 0, 0], [0, y, 0, 0],
                     [0, 0, (FAR + NEAR) / (NEAR - FAR), 2 * FAR * NEAR / (NEAR - FAR)], [0, 0, -1, 0]])


def main(file="embed.png", size=(640, 360), frames=16, settings=None):
    context = create_headless_context()  # in a window: the window's
    projection = projection_matrix(size[0] / size[1])
    view = np.eye(4)
    view[:3, 3] = -np.array(EYE)

    # The host: a G-buffer with what any deferred renderer has
    normal, radiance, albedo = (context.texture(size, 4, dtype="f2") for _ in range(3))
    depth = context.depth_texture(size)
    gbuffer = context.framebuffer([normal, radiance, albedo], depth)
    program = context.program(GBUFFER_VERTEX, GBUFFER_FRAGMENT)
    program["clip_from_view"].write(projection.T.astype("f4").tobytes())
    program["view_from_world"].write(view.T.astype("f4").tobytes())
    program["lamp"], program["power"] = LAMP, POWER
    layout = ("3f 3f 3f", "position", "normal", "albedo")
    room = context.vertex_array(program, [(context.buffer(room_vertices()), *layout)])
    compose = context.program(COMPOSE_VERTEX, COMPOSE_FRAGMENT)
    screen = context.simple_framebuffer(size)

    # The guest
    lighting = IndirectLighting(context, size, settings or Settings())
    for _ in range(frames):
        gbuffer.use()
        gbuffer.clear()
        context.enable_only(moderngl.DEPTH_TEST)
        room.render()
        irradiance = lighting.compute(depth=depth, normal=normal, normal_space="world", radiance=radiance,
                                      projection=projection, view_from_world=view)
        screen.use()
        context.enable_only(moderngl.NOTHING)
        for unit, (name, texture) in enumerate({"radiance": radiance, "albedo": albedo,
                                                "irradiance": irradiance}.items()):
            texture.use(unit)
            compose[name] = unit
        context.vertex_array(compose, []).render(vertices=3)

    picture = np.frombuffer(screen.read(), np.uint8).reshape(size[1], size[0], 3)[::-1]
    Image.fromarray(np.ascontiguousarray(picture)).save(file)
    result = np.frombuffer(irradiance.read(), np.float16).reshape(size[1], size[0], 4)[::-1, :, :3]
    lighting.release()
    context.release()
    return result.astype(np.float32)


if __name__ == "__main__":
    main()
