# Python 3.11, 3.12 or 3.13 and make are all it takes; everything else goes into .venv beside this
# file. `make PYTHON=/path/to/python3.12 …` chooses the interpreter.

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
SPARK := $(VENV)/.spark
CANDIDATES := $(or $(PYTHON),python3.11 python3.12 python3.13 python3 python)
KERNELS := $(CURDIR)/build/kernels
BENCH := .venv-bench

# Spark takes half a gigabyte and is only needed for its tests: it has a lock of its own.
ONLY_SPARK := pyspark py4j
COMPILE := --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
  --custom-compile-command 'make lock'

.PHONY: help demo test lint format lock bench fuzz kills soak clean
.DEFAULT_GOAL := help

help:
	@echo 'make demo    install what is needed and run the demonstration'
	@echo 'make test    check style, types and layers, and run every test'
	@echo 'make lint    check style, types and layers only'
	@echo 'make format  put the code into its style'
	@echo 'make bench   time surefix beside its peers, and write docs/benchmarks.*'
	@echo 'make kills   kill the live service a thousand times'
	@echo 'make fuzz    read ten million mutated sentences'
	@echo 'make soak    take 4.3 million sentences through the live service'
	@echo 'make lock    resolve the dependencies anew into requirements.lock'
	@echo 'make clean   remove what make made'

demo: $(INSTALLED)
	$(BIN)/surefix demo

# Kernels are compiled afresh: a cached caller can outlive the kernel it calls.
test: lint $(SPARK)
	rm -rf $(KERNELS)
	NUMBA_CACHE_DIR=$(KERNELS) $(BIN)/surefix warmup
	NUMBA_CACHE_DIR=$(KERNELS) $(BIN)/python -m pytest -n 2 --dist loadgroup

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(INSTALLED)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock: $(INSTALLED)
	$(BIN)/python -m pip install --quiet uv
	printf 'hatchling\neditables\nsetuptools\n' | $(BIN)/uv pip compile $(COMPILE) --upgrade \
	  --all-extras --group pyproject.toml:dev $(ONLY_SPARK:%=--no-emit-package %) \
	  --output-file requirements.lock pyproject.toml -
	printf '%s\n' $(ONLY_SPARK) | $(BIN)/uv pip compile $(COMPILE) --upgrade \
	  --constraint requirements.lock --output-file requirements-spark.lock -

# Long forms of tests that `make test` runs a part of; what they found is in docs/live.md.
kills: $(INSTALLED)
	PYTHONPATH=tests NUMBA_CACHE_DIR=$(KERNELS) $(BIN)/python -m service.kills

fuzz: $(INSTALLED)
	PYTHONPATH=tests NUMBA_CACHE_DIR=$(KERNELS) $(BIN)/python -m faults.fuzz

soak: $(INSTALLED)
	PYTHONPATH=tests NUMBA_CACHE_DIR=$(KERNELS) $(BIN)/python -m service.soak

# Peers live in an environment of their own, and one that cannot be installed is left out.
bench: $(BENCH)/.installed
	NUMBA_CACHE_DIR=$(KERNELS) $(BENCH)/bin/python bench/run.py

$(BENCH)/.installed: $(INSTALLED) bench/requirements.txt
	$(BIN)/python -m venv $(BENCH)
	@$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check --editable .
	@grep -v '^#' bench/requirements.txt | while read -r peer; do \
	  $(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check "$$peer" \
	    || echo "$$peer cannot be installed: skipped"; done
	@touch $@

clean:
	rm -rf $(VENV) $(BENCH) build dist .mypy_cache .pytest_cache .ruff_cache .import_linter_cache

$(INSTALLED): requirements.lock pyproject.toml
	@found=; for python in $(CANDIDATES); do \
	  if $$python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
	    >/dev/null 2>&1; then found=$$python; break; fi; done; \
	if [ -z "$$found" ]; then \
	  echo 'surefix needs Python 3.11, 3.12 or 3.13 and found none as: $(CANDIDATES).' >&2; \
	  echo 'Install one, or name it: make PYTHON=/path/to/python3.12 demo' >&2; exit 1; fi; \
	echo "Creating $(VENV) with $$($$found --version)"; \
	$$found -m venv $(VENV) || { \
	  echo 'The venv module is missing; on Debian and Ubuntu: apt install python3-venv' >&2; exit 1; }
	@echo 'Installing the locked dependencies (a few minutes the first time)'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes \
	  --requirement requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation \
	  --no-deps --editable .
	@touch $@

$(SPARK): requirements-spark.lock $(INSTALLED)
	@echo 'Installing Apache Spark for its tests'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes \
	  --no-build-isolation --requirement requirements-spark.lock
	@touch $@
