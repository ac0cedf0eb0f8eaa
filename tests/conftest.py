"""OpenGL for the tests: one EGL context for the whole session, whose error state is checked around each test."""

from __future__ import annotations

from typing import Callable, Iterator

import moderngl
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.context import create_headless_context, read_capabilities
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Scene
from ssil_viewer.settings import Settings


@pytest.fixture(scope="session")
def session_context() -> Iterator[moderngl.Context]:
    """The context, made when the first test asks for it; tests of the window lay it aside while they run."""
    try:
        context = create_headless_context()
    except UserError as error:
        pytest.skip(str(error))
    with context:
        # moderngl makes a framebuffer and then binds the one that was bound before, which must still be there.
        context.resting_framebuffer = context.simple_framebuffer((1, 1))
        yield context
    context.release()


@pytest.fixture
def context(session_context: moderngl.Context) -> Iterator[moderngl.Context]:
    """The session's context; the test fails when it leaves an OpenGL error behind."""
    with session_context:
        session_context.resting_framebuffer.use()
        assert session_context.error == "GL_NO_ERROR", "left by an earlier test"
        yield session_context
        assert session_context.error == "GL_NO_ERROR"


@pytest.fixture(params=("compute", "fragment"))
def stage(request: pytest.FixtureRequest, context: moderngl.Context) -> str:
    """Both ways in which screen passes compile; only the second where OpenGL is older than 4.3."""
    if request.param == "compute" and not read_capabilities(context).compute:
        pytest.skip("compute shaders need OpenGL 4.3")
    return request.param


@pytest.fixture
def make_renderer(context: moderngl.Context) -> Iterator[Callable[..., Renderer]]:
    """`make(scene, size, stage="auto", **settings)`: a renderer with `final` and `glossy`, released after the test."""
    made: list[Renderer] = []

    def make(scene: Scene, size: tuple[int, int], stage: str = "auto", **settings: object) -> Renderer:
        renderer = Renderer(context, size, Settings(**settings), stage=stage, keep=("final", "glossy"))
        made.append(renderer)
        renderer.set_scene(scene)
        return renderer

    yield make
    context.resting_framebuffer.use()
    for renderer in made:
        renderer.release()
