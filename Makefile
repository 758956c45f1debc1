# Everything works from a fresh clone; only Python 3.11 or newer has to be there.
#   make setup   .venv with the command mocca-robot in it
#   make demo    a leaning tower: designed, checked in physics, reported
#   make test    style, types and tests
#   make browser  the viewer and the pages in headless Chromium
#   make docs    the documentation site, in site/, from pages that are up to date
#   make dist-test  wheel and source archive, built and tried in an environment of their own
#   make gallery  run all configurations again and draw the gallery
#   make bench   all measurements, the long ones included; writes docs/benchmarks.md
#   make bench-quick   three minutes of them, compared with the last time on this machine
#   make compas  an environment with compas_cra, which make bench then compares with

PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 python; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& { echo $$p; break; }; done)
VENV := .venv
PROGRAMS := $(if $(filter Windows_NT,$(OS)),Scripts,bin)
BIN := $(VENV)/$(PROGRAMS)
STAMP := $(VENV)/.installed
WORKERS ?= 2
BENCHES ?= agreement agreement_configs agreement_loads insertions contacts statics friction samples tilt_sweep states baseline configs growth physics plans profile builds
QUICK ?= configs contacts statics friction baseline growth
COMPAS := .venv-compas
ifneq ($(wildcard $(COMPAS)/$(PROGRAMS)/python),)
export MOCCA_COMPAS_PYTHON ?= $(CURDIR)/$(COMPAS)/$(PROGRAMS)/python
endif

export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1

.DEFAULT_GOAL := help
.PHONY: help setup demo test style types unit browser docs gallery dist-test bench bench-quick clean

help:
	@sed -n 's/^#   //p' Makefile

setup: $(STAMP)

$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "mocca-robot needs Python 3.11 or newer, but no python3 here is that new." >&2; \
		echo "Install one (Debian: apt install python3 python3-venv), or name it: make setup PYTHON=/path/to/python3.12" >&2; \
		exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "mocca-robot needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) -V 2>&1)." >&2; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
		echo "$(PYTHON) cannot make a virtual environment; on Debian: apt install python3-venv" >&2; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $(STAMP)

demo: setup
	@$(BIN)/mocca-robot run configs/leaning_tower_20.yaml --quick -o out/leaning_tower_20; status=$$?; \
		echo "Open $(CURDIR)/out/leaning_tower_20/report.html"; exit $$status

# All three even when one fails, so that one run tells everything; pytest's closing line comes last.
test: setup
	@failed=0; for check in style types unit; do $(MAKE) --no-print-directory $$check || failed=1; done; exit $$failed

style: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/mypy

# Tests of the robot driver watch a clock of 100 ms and so do not share the machine with tests that compute; with each other
# they may, since they wait most of the time.
unit: setup
	@failed=0; $(BIN)/python -m pytest -n $(WORKERS) -m "not long and not browser" --ignore=tests/ur || failed=1; \
	$(BIN)/python -m pytest -n $(WORKERS) -m "not long and not browser" tests/ur || failed=1; exit $$failed

browser: setup
	@command -v chromium chromium-browser google-chrome >/dev/null || { \
		echo "The browser tests need Chromium; on Debian: apt-get install chromium" >&2; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[browser]'
	$(BIN)/python -m pytest -m browser

docs: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	$(BIN)/python docs/generate.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

dist-test: setup
	$(BIN)/python -m pytest -n 0 -m "long or not long" tests/project/test_dist.py

gallery: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	$(BIN)/python docs/gallery.py
	$(BIN)/python docs/generate.py

bench: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	$(BIN)/python -m pytest -n $(WORKERS) -m "long and not browser"
	@for name in $(BENCHES); do echo "== $$name"; $(BIN)/python -m benchmarks $$name --keep || exit 1; done
	$(BIN)/python -m benchmarks page

bench-quick: setup
	@for name in $(QUICK); do echo "== $$name"; $(BIN)/python -m benchmarks $$name --quick --compare --keep || exit 1; done

# compas_cra needs packages of its own versions, so it gets an environment of its own.
compas:
	@test -x $(COMPAS)/$(PROGRAMS)/python || $(PYTHON) -m venv $(COMPAS)
	$(COMPAS)/$(PROGRAMS)/python -m pip install --quiet --disable-pip-version-check 'compas_cra>=0.8,<0.9' 'compas_assembly>=0.7,<0.8'

clean:
	rm -rf out build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis
