# `make demo` and `make test` need Python 3.11 or newer, make and git; the rest is installed into .venv at the first call.

PYTHON := $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
WORKERS ?= 2

.PHONY: demo test lint prove studies system clean

demo: $(STAMP)
	$(BIN)/workbench demo

test: lint
	$(BIN)/pytest -n $(WORKERS) --dist loadfile -m "not slow"

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

prove: $(STAMP)
	$(BIN)/pytest -n $(WORKERS) --dist loadfile -m slow

studies: $(STAMP)
	@set -e; for study in studies/*/study.py studies/*.py; do \
	  if [ -e "$$study" ]; then echo "== $$study"; $(BIN)/python "$$study"; fi; done

# Libraries of the operating system that no Python package brings; installs what is missing where that is allowed.
system:
	@.ci/system "$(PYTHON)"

$(STAMP): pyproject.toml
	@.ci/system "$(PYTHON)"
	@test -x $(BIN)/python || "$(PYTHON)" -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) runs dist build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
