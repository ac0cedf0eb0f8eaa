# `make run` and `make test` do all set-up themselves, on a fresh clone too; see tools/setup.sh.
#
#   make run SCENE=model.glb ARGS="--samples 128"
#   make test ARGS="-k camera -x"

PY = .venv/bin/python
SCENE ?= builtin:atrium
ARGS ?=

.PHONY: help run test test-gl41 lint docs pictures wheel

help:
	@echo "make run       open the viewer (SCENE=file, ARGS=flags); renders to a file where there is no display"
	@echo "make test      run all tests, then test-gl41 (ARGS=flags of pytest, for one run of their choice)"
	@echo "make test-gl41 run the tests that draw once more on OpenGL 4.1, without compute shaders"
	@echo "make lint      check the style"
	@echo "make docs      write docs/settings.md anew"
	@echo "make pictures  render docs/images anew (ARGS=names of pictures)"
	@echo "make wheel     build dist/*.whl"

run:
	@sh tools/setup.sh run
	@if [ -n "$$DISPLAY" ] || [ "$$(uname)" = Darwin ]; then \
		exec $(PY) -m ssil_viewer view "$(SCENE)" $(ARGS); \
	else \
		echo "No display: rendering the first frame to a file instead."; \
		mkdir -p out; \
		exec $(PY) -m ssil_viewer render "$(SCENE)" -o out/first-frame.png --timings $(ARGS); \
	fi

# The second run is for Linux, where Mesa can pretend to have OpenGL 4.1 alone.
test:
	@sh tools/setup.sh test
	$(PY) -m pytest $(ARGS)
	$(if $(strip $(ARGS)),,@[ "$$(uname)" != Linux ] || $(MAKE) --no-print-directory test-gl41)

lint:
	@sh tools/setup.sh test
	$(PY) -m ruff check .

docs:
	@sh tools/setup.sh run
	$(PY) tools/make_docs.py

pictures:
	@sh tools/setup.sh run
	$(PY) tools/make_pictures.py $(ARGS)

wheel:
	@sh tools/setup.sh test
	$(PY) -m hatchling build -t wheel -d dist

# The tests that draw, once more without compute shaders, as on macOS; Mesa only.
test-gl41:
	@sh tools/setup.sh test
	MESA_GL_VERSION_OVERRIDE=4.1 MESA_GLSL_VERSION_OVERRIDE=410 $(PY) -m pytest -m "not slow" tests/glsl tests/passes \
		tests/render $(ARGS)
