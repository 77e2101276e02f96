# Two commands do everything on a fresh machine: `make oring` and `make test`.
# Needed beforehand: Python >= 3.11 with venv and headers, a C compiler, make.

PYTHON ?= python3
OUT ?= results/oring
# each process computes on one thread: the work is spread over processes
export OMP_NUM_THREADS ?= 1

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
GENERATED := $(wildcard generated/*.c generated/*.h generated/manifest.json)
BUILDER := $(wildcard codegen/tools/build.py codegen/abi.py)

.PHONY: help oring test slow lint check format docs clean

help:
	@echo "make oring    solve the O-ring and write its film-thickness curve to $(OUT)"
	@echo "make test     run the test suite"
	@echo "make slow     the tests that take minutes"
	@echo "make lint     ruff and mypy; make check: lint and test"
	@echo "make docs     the pages of docs/ as a site, in build/docs"
	@echo "make clean    remove the environment and everything built"

oring: $(VENV)/.kernels
	$(BIN)/softehl run oring --out $(OUT)

test: $(VENV)/.dev $(VENV)/.kernels
	$(BIN)/python -m pytest -n 2

slow: $(VENV)/.dev $(VENV)/.kernels
	$(BIN)/python -m pytest -n 2 -m slow

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

check: lint test

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find codegen generated runtime cases tests -name __pycache__ -prune -exec rm -rf {} +
	find generated \( -name '*.so' -o -name '*.o' -o -name '*.dylib' \) -delete

# The stamps are touched last, so an interrupted step is done again.
$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "softehl needs Python >= 3.11, but '$(PYTHON)' is $$($(PYTHON) --version 2>&1);" \
	    "name another one: make PYTHON=python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.installed: pyproject.toml $(VENV)/.created
	@echo "installing into $(VENV), this takes about a minute"
	$(PIP) install --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.installed
	$(PIP) install --editable '.[dev]'
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	$(PIP) install --editable '.[docs]'
	@touch $@

$(VENV)/.kernels: $(GENERATED) $(BUILDER) $(VENV)/.installed
	$(BIN)/python -m softehl.codegen.tools.build
	@touch $@
