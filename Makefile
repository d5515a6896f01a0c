# Each target makes what it needs: a virtual environment in $(VENV), with the versions of constraints.txt.
PYTHON ?= python3
VENV ?= .venv
PYTEST_ARGS ?= -n auto --maxprocesses 4 --dist worksteal
FUZZ_TABLES ?= 100000
FUZZ_SECONDS ?= 1800

BIN := $(VENV)/bin
# modules are compiled when they are first imported: pip would compile all of them, one after the other
PIP := $(BIN)/python -m pip install --no-compile -c constraints.txt
BENCHMARKS := $(sort $(filter-out benchmarks/_% benchmarks/make_%,$(wildcard benchmarks/*.py)))
# the workers of a test or a benchmark share the cores; BLAS must not take them too
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
# where compiled modules are not kept, each of the hundreds of processes of the tests compiles them anew
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test slow fuzz lint docs bench versions clean

help:  ## list the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

demo: $(VENV)/.installed  ## forecast tomorrow from a log, beside simple baselines (installs the core only)
	$(BIN)/skhybrid demo

test: $(VENV)/.installed-test  ## run the tests, with every extra (PYTEST_ARGS= for one process)
	$(ONE_THREAD) $(BIN)/python -m pytest $(PYTEST_ARGS) -m "not slow"

slow: $(VENV)/.installed-test  ## run the tests of minutes: code in the documentation, clusters, killed processes
	$(ONE_THREAD) $(BIN)/python -m pytest $(PYTEST_ARGS) -m slow

fuzz: $(VENV)/.installed-test  ## odd tables and files for hours; FUZZ_SECONDS= per reader; a stopped run goes on
	@status=0; $(ONE_THREAD) $(BIN)/python tests/fuzz tables --count $(FUZZ_TABLES) --seconds 14400 || status=1; \
	for reader in csv toml model store; do \
	  $(ONE_THREAD) $(BIN)/python tests/fuzz $$reader --seconds $(FUZZ_SECONDS) || status=1; \
	done; $(BIN)/python tests/fuzz report; exit $$status

lint: $(VENV)/.installed-lint  ## ruff, mypy, and the language of the documentation
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python tools/prose.py

docs: $(VENV)/.installed-docs  ## build the documentation; a warning is an error
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

bench: $(VENV)/.installed-test  ## run the benchmarks
	@test -n "$(BENCHMARKS)" || { echo "there is nothing in benchmarks"; exit 1; }
	@set -e; for script in $(BENCHMARKS); do echo "== $$script"; $(ONE_THREAD) $(BIN)/python "$$script"; done

versions:  ## test the oldest and the newest versions, wheel and sdist; audit (VERSIONS="oldest --folder DIR")
	$(PYTHON) tools/versions.py $(VERSIONS)

clean:  ## remove what the other targets made
	rm -rf $(VENV) build *.egg-info docs/_build docs/auto_examples docs/generated .mypy_cache .pytest_cache .ruff_cache

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

# the core: what a forecast needs
$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) -e .
	@touch $@

$(VENV)/.installed-lint: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) -e ".[lint]"
	@touch $@

# torch comes first and alone, so that a build for CPU is taken where one is at hand
$(VENV)/.torch: constraints.txt | $(BIN)/python
	$(PIP) torch
	@touch $@

$(VENV)/.installed-%: $(VENV)/.torch pyproject.toml constraints.txt
	$(PIP) -e ".[$*]"
	@touch $@
