"""Which OpenGL is asked for."""

from __future__ import annotations

from types import SimpleNamespace

import moderngl
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.context import create_headless_context, read_capabilities


@pytest.fixture
def driver(monkeypatch):
    """`driver(newest)`: one that gives exactly the version asked for, up to its newest, as NVIDIA's does."""
    def install(newest, platform="linux"):
        asked = []

        def create_context(require, **_):
            asked.append(require)
            if require > newest:
                raise Exception("cannot create context")    # glcontext raises no other
            return SimpleNamespace(version_code=require, info=dict.fromkeys(
                ("GL_RENDERER", "GL_VENDOR", "GL_VERSION"), "x") | {"GL_MAX_TEXTURE_SIZE": 16384})

        monkeypatch.setattr(moderngl, "create_context", create_context)
        monkeypatch.setattr("sys.platform", platform)
        return asked

    return install


@pytest.mark.parametrize(("newest", "given", "compute"), [(460, 430, True), (430, 430, True), (410, 410, False),
                                                          (330, 330, False)])
def test_the_newest_that_serves(driver, newest, given, compute):
    driver(newest)
    capabilities = read_capabilities(create_headless_context())
    assert capabilities.code == given and capabilities.compute == compute


def test_macos_is_not_asked_for_what_it_never_has(driver):
    asked = driver(410, "darwin")
    create_headless_context()
    assert asked == [410]


def test_none_that_serves(driver):
    assert (asked := driver(320)) == []
    with pytest.raises(UserError, match="OpenGL 3.3"):
        create_headless_context()
    assert asked == sorted(asked, reverse=True) and asked[-1] == 330
