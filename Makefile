# beliefd: every target makes what it needs, from a fresh clone.  `make help` lists them.
PYTHON ?= python3
SEEDS ?= 20
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install demo test coverage lint format bench system docs figures accuracy honesty clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "beliefd needs Python 3.11 or newer; PYTHON=... make install chooses one")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

install: $(INSTALLED) ## set up .venv and compile the kernels
	$(BIN)/beliefd warm --all

demo: install ## the main job, live in the terminal for a minute
	$(BIN)/beliefd demo

test: install ## every test
	$(BIN)/python -m pytest -n 2 --dist worksteal

coverage: install ## branch coverage of filters/, its kernels run as plain Python too
	rm -f .coverage .coverage.*
	COVERAGE_FILE=.coverage.compiled $(BIN)/python -m pytest tests/filters -n 2 --dist worksteal --cov=filters --cov-report=
	COVERAGE_FILE=.coverage.interpreted NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest tests/filters -m interpreted \
	  -n 2 --dist worksteal --cov=filters --cov-report= -W ignore::RuntimeWarning
	$(BIN)/coverage combine .coverage.compiled .coverage.interpreted
	$(BIN)/coverage report --include 'filters/*' --show-missing --skip-covered --fail-under 95

lint: $(INSTALLED) ## style, types and the walls between the packages
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright --warnings

format: $(INSTALLED) ## let ruff rewrite the sources
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: install ## what this machine affords, and how the loop keeps its deadlines
	$(BIN)/python benchmarks/step.py --models
	$(BIN)/python benchmarks/afford.py
	$(BIN)/python benchmarks/mechanisms.py
	$(BIN)/python benchmarks/compare.py
	$(BIN)/python benchmarks/saturation.py
	$(BIN)/python benchmarks/memory.py
	$(BIN)/python benchmarks/start.py
	$(BIN)/python benchmarks/deadline.py --matrix

system: install ## the daemon under real systemd with a real vcan0, in a guest
	bash tests/system/run.sh

docs: $(INSTALLED) ## the pages that are generated
	$(BIN)/python -m service.config.reference > docs/configuration.md
	$(BIN)/python -m service.publish.reference > docs/wire.md

figures: install ## the figures of docs/filters/, from the filters themselves
	NUMBA_CACHE_DIR=$$($(BIN)/python -c 'from service import kernels; print(kernels.prepare())') PYTHONPATH=. $(BIN)/python docs/figures.py
	$(BIN)/beliefd textbook --out docs/filters/textbook

accuracy: install ## replay every recording there is, and write the table of docs/accuracy.md
	$(BIN)/python docs/accuracy.py --seeds $(SEEDS)

honesty: install ## claimed against observed coverage, and what each mechanism is worth, into docs/accuracy.md
	$(BIN)/python docs/honesty.py --seeds $(SEEDS)

clean: ## remove everything that was made
	rm -rf $(VENV) .vm build dist .pytest_cache .ruff_cache .hypothesis .coverage .coverage.*
