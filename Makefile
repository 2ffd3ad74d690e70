# Needs Python 3.11 or newer and make; everything else is installed into .venv, once.
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3; do \
	command -v $$p >/dev/null && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	&& echo $$p && break; done)
SCENE ?= sprint
OUT ?= runs/$(SCENE)
OPTIMIZE_FLAGS ?=

.PHONY: help run test bounds compat lowest newest bench lint docs wasm clean

help:
	@echo "make run    search a better row than the best uniform one: SCENE=$(SCENE), into $(OUT)"
	@echo "make test   all tests"
	@echo "make bounds tests of compiled code, with every index checked"
	@echo "make compat checkers and wrappers of Gymnasium, Stable-Baselines3 and Minari"
	@echo "make lowest, make newest"
	@echo "            methods and environments with the lowest or newest versions of dependencies"
	@echo "make bench  timings with the error beside them"
	@echo "make lint   ruff, mypy, import-linter, codespell"
	@echo "make docs   the documentation as a site, into site/"
	@echo "make wasm   the kernels as WebAssembly, for the page: after a change of them; needs Node.js"
	@echo "make clean  remove the virtual environment and caches"

run: $(VENV)/.core
	$(BIN)/domino optimize $(SCENE) $(OPTIMIZE_FLAGS) --out $(OUT) --resume

# Files as wholes: what a file sets up once, a cluster say, is set up once. Three processes keep two
# cores busy, as some tests wait for a browser or another process; threads of linear algebra would
# only wait for each other.
test: export OMP_NUM_THREADS := 1
test: $(VENV)/.dev
	$(BIN)/python -m pytest -n 3 --dist loadfile

# Machine code checks no index otherwise; with the checks it is another, so it has its own folder.
bounds: export NUMBA_BOUNDSCHECK := 1
bounds: export NUMBA_CACHE_DIR := $(CURDIR)/build/bounds
bounds: export OMP_NUM_THREADS := 1
bounds: $(VENV)/.dev
	$(BIN)/python -m pytest -n 2 tests/test_views.py tests/domino_env/envs tests/domino_env/physics

# Every search method, a stock and the vector environments, in an environment of its own. Warnings of
# other versions than the pinned ones are no errors.
lowest: REQUIREMENTS = $(shell $(PYTHON) -c 'import re, tomllib; \
	print(*(re.sub(">=", "==", d) for d in tomllib.load(open("pyproject.toml", "rb"))["project"]["dependencies"]))')
newest: REQUIREMENTS = --upgrade .
lowest newest: export OMP_NUM_THREADS := 1
lowest newest:
	$(PYTHON) -m venv --clear $(VENV)-$@
	$(VENV)-$@/bin/python -m pip install --quiet --disable-pip-version-check $(REQUIREMENTS)
	$(VENV)-$@/bin/python -m pip install --quiet --disable-pip-version-check \
		pytest pytest-xdist hypothesis -e .
	$(VENV)-$@/bin/python -m pytest -n 2 --dist loadfile -W default tests/optimize/methods \
		tests/optimize/test_rules.py tests/domino_env/scenes/test_design_space.py tests/optimize/test_journal.py tests/domino_env/envs/test_vector.py

compat: $(VENV)/.dev
	$(PIP) --group compat
	$(BIN)/python -m pytest -n 2 tests/compat.py

bench: $(VENV)/.core
	$(BIN)/python -m benchmarks

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

docs: $(VENV)/.docs
	$(BIN)/mkdocs build --strict --quiet
	@echo "site/index.html; with search: $(BIN)/python -m http.server -d site, http://localhost:8000"

wasm: $(VENV)/.core
	$(PIP) --group wasm
	$(BIN)/python -m optimize.studio.wasm.build

# An environment that was not finished would pass for one the next time.
$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: install it," \
		"or name one with make PYTHON=/path/to/python" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# The build runs in the environment itself, so that the version of setuptools is pinned too; an
# older pip than 25.1 has no `--group`.
$(VENV)/.core: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing into $(VENV)"
	$(PIP) pip setuptools
	$(PIP) --no-build-isolation -e .
	@touch $@

# The simulator is compiled meanwhile.
$(VENV)/.dev: $(VENV)/.core
	$(BIN)/python -m benchmarks compilation >/dev/null 2>&1 & \
	$(PIP) --no-build-isolation --group dev \
		-e '.[rl,render,verify,dist,parquet,minari]' && wait
	@touch $@

$(VENV)/.docs: $(VENV)/.core
	$(PIP) --no-build-isolation -e '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) $(VENV)-lowest $(VENV)-newest build site *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis \
		.import_linter_cache
