# `make run` and `make test` do all set-up themselves, on a fresh clone too; see tools/setup.sh.
#
#   make run SCENE=model.glb ARGS="--samples 128"
#   make test ARGS="-k camera -x"

PY = .venv/bin/python
SCENE ?= builtin:atrium
ARGS ?=

.PHONY: help run test lint docs pictures wheel

help:
	@echo "make run       open the viewer (SCENE=file, ARGS=flags); renders to a file where there is no display"
	@echo "make test      run all tests (ARGS=flags of pytest)"
	@echo "make lint      check the style"
	@echo "make docs      write docs/settings.md anew"
	@echo "make pictures  render docs/images anew (ARGS=names of pictures)"
	@echo "make wheel     build dist/*.whl"

run:
	@sh tools/setup.sh run
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ] || [ "$$(uname)" = Darwin ]; then \
		exec $(PY) -m ssil_viewer view "$(SCENE)" $(ARGS); \
	else \
		echo "No display: rendering the first frame to a file instead."; \
		mkdir -p out; \
		exec $(PY) -m ssil_viewer render "$(SCENE)" -o out/first-frame.png --timings $(ARGS); \
	fi

test:
	@sh tools/setup.sh test
	$(PY) -m pytest $(ARGS)

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
