# Two commands do everything on a fresh machine: `make oring` and `make test`.
# Needed beforehand: Python >= 3.11 with venv and headers, a C compiler, make.

PYTHON ?= python3
OUT ?= results/oring
# each process computes on one thread: the work is spread over processes
export OMP_NUM_THREADS ?= 1
# the tests start hundreds of processes: they load the byte code that the first one has made
export PYTHONDONTWRITEBYTECODE =

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
GENERATED := $(wildcard generated/*.c generated/*.h generated/manifest.json)
BUILDER := $(wildcard codegen/tools/build.py codegen/abi.py)
# a second Python, on which `make test-other` runs the tests
OTHERS ?= python3.13 python3.12 $(wildcard $(HOME)/.pyenv/versions/3.13.*/bin/python \
	$(HOME)/.pyenv/versions/3.12.*/bin/python)
# what depends on the language: public names, reading of pages, building, packages, files, commands; one
# study and one seal. Numbers come from the same C, so the others repeat.
OTHER_TESTS := $(wildcard tests/test_*.py) tests/packaging \
	$(addprefix tests/codegen/test_,cache.py emit_and_build.py fields.py generated_is_current.py \
	import_record.py mistakes.py named_symbols.py sympy_lowering.py user_models.py) \
	tests/runtime/test_study.py tests/cases/test_cli.py tests/cases/test_driver.py
# a Python for which PETSc comes as wheels: `make mpi` makes an environment with it
MPI_PYTHONS ?= python3.12 $(wildcard $(HOME)/.pyenv/versions/3.12.*/bin/python) python3.13 \
	$(wildcard $(HOME)/.pyenv/versions/3.13.*/bin/python) $(PYTHON)

.PHONY: help oring test test-other mpi mpi-tests hosts hosts-tests slow torture wheel lint check format docs pictures clean

help:
	@echo "make oring    solve the O-ring and write its film-thickness curve to $(OUT)"
	@echo "make test     run the test suite"
	@echo "make slow     the tests that take minutes"
	@echo "make wheel    build the wheel, install it elsewhere and use it, with and without compiler"
	@echo "make test-other    what depends on the language on a second Python, where one is installed"
	@echo "make mpi      the engine petsc on 1, 2 and 3 processes, where Python >= 3.12 is installed"
	@echo "make hosts    JAX, NGSolve and CalculiX with generated pages; CalculiX where apt-get builds it"
	@echo "make lint     ruff and mypy; make check: lint and test"
	@echo "make docs     the pages of docs/ as a site, in build/docs"
	@echo "make clean    remove the environment and everything built"

oring: $(VENV)/.kernels
	$(BIN)/softehl run oring --overwrite --out $(OUT)

# worksteal: neighbours, which share what they are tested on, stay in one process
test: $(VENV)/.dev $(VENV)/.kernels
	$(BIN)/python -m pytest -n 2 --dist worksteal $(TESTS)

slow: $(VENV)/.compiler $(VENV)/.kernels
	$(BIN)/python -m pytest -n 2 --dist worksteal -m slow

wheel: $(VENV)/.dev
	$(BIN)/python -m tests.packaging.wheel

test-other:
	@main=$$($(PYTHON) -c 'import sys; print(sys.version_info[:2])'); \
	for other in $(OTHERS); do \
	  found=$$($$other -c 'import sys, venv, ensurepip; print(sys.version_info[:2])' 2>/dev/null); \
	  if [ -n "$$found" ] && [ "$$found" != "$$main" ]; then \
	    echo "the tests on $$($$other --version)"; \
	    exec $(MAKE) test VENV=.venv-other PYTHON="$$other" TESTS="$(OTHER_TESTS)"; \
	  fi; \
	done; \
	echo "no second Python is installed (looked for: $(OTHERS)): its tests are left out"

mpi:
	@for found in $(MPI_PYTHONS); do \
	  if $$found -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 12))' 2>/dev/null; \
	  then \
	    echo "PETSc on $$($$found --version)"; \
	    exec $(MAKE) mpi-tests VENV=.venv-mpi PYTHON="$$found"; \
	  fi; \
	done; \
	echo "no Python >= 3.12 is installed (looked for: $(MPI_PYTHONS)): the tests of PETSc are left out"

# the last line: cells and materials of ours in DOLFINx, which the same wheel brings
mpi-tests: $(VENV)/.mpi $(VENV)/.kernels
	$(BIN)/python -m pytest -m mpi tests/mpi
	$(BIN)/python -m pytest tests/codegen/test_dolfinx.py tests/codegen/hosts/test_dolfinx_material.py

# other programs: JAX and NGSolve from wheels in an environment of their own, CalculiX from source
hosts:
	@exec $(MAKE) hosts-tests VENV=.venv-hosts

hosts-tests: $(VENV)/.hosts $(VENV)/.kernels
	@mkdir -p build/ccx
	PATH="$(CURDIR)/$(BIN):$$PATH" \
	  SOFTEHL_CCX="$$($(BIN)/python -m tests.codegen.hosts.ccx build/ccx)" \
	  $(BIN)/python -m pytest -rs tests/codegen/hosts -m "slow or not slow"

# faults from outside, at most 15 minutes; writes its table into docs/reliability.md
torture: $(VENV)/.dev $(VENV)/.kernels
	$(BIN)/python -m tests.torture 15 docs/reliability.md

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

check: lint test

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -W --keep-going -q -b html -c docs . build/docs
	@echo build/docs/docs/index.html

pictures: $(VENV)/.kernels
	$(BIN)/python docs/pictures.py
	$(BIN)/python docs/section_pictures.py
	$(BIN)/python docs/report_pictures.py
	PYTHONPATH=. $(BIN)/python docs/gallery/pictures.py

clean:
	rm -rf $(VENV) .venv-other .venv-mpi .venv-hosts build dist src/*.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find codegen generated runtime cases tests -name __pycache__ -prune -exec rm -rf {} +
	rm -f generated/*.so generated/*.sha256

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

# a compiler of 400 MB for the tests of machines without one, and of other systems
$(VENV)/.compiler: $(VENV)/.dev
	$(PIP) install --editable '.[dev,compiler]'
	@touch $@

$(VENV)/.mpi: $(VENV)/.dev
	$(PIP) install --editable '.[dev,mpi]'
	@touch $@

$(VENV)/.hosts: $(VENV)/.dev
	$(PIP) install --editable '.[dev,hosts]'
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	$(PIP) install --editable '.[docs]'
	@touch $@

# Kernels are compiled into the user's cache at their first use: this is one, before anything waits.
$(VENV)/.kernels: $(GENERATED) $(BUILDER) $(VENV)/.installed
	$(BIN)/python -m softehl.codegen.tools.build
	@touch $@
