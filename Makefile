# Two commands do everything on a fresh machine with Python 3.11 or newer:
#   make demo    simulate a pair of captures and turn it into depth
#   make test    lint, types, tests, wheel
# and make docs writes the API reference to build/docs
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := demo
PACKAGES := container lenslet develop lightfield rig focus depth simulate network training batch viewer
MODULES := conventions errors options pipeline stack_pipeline results \
	lightfield.decoding lightfield.field lightfield.perspective lightfield.store

.PHONY: demo test lint types tests wheel docs clean

demo: $(VENV)/.installed
	$(BIN)/lfstereo demo -o $(DEMO) --force

test: lint types tests wheel

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy

tests: $(VENV)/.installed-dev
	$(BIN)/python -m pytest

wheel: $(VENV)/.installed-dev
	$(BIN)/python -m build --no-isolation --outdir build/dist .

docs: $(VENV)/.installed-dev
	$(BIN)/pdoc --docformat numpy -o build/docs $(addprefix lfstereo.,$(PACKAGES) $(MODULES))

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "lfstereo needs Python 3.11 or newer; set PYTHON=")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --prefer-binary --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --prefer-binary --editable '.[dev]'
	touch $@ $(VENV)/.installed

clean:
	rm -rf build dist $(DEMO)
