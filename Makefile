# `make demo` and `make test` need Python 3.11 or newer, make and git; the rest is installed into .venv at the first call.

# The first that runs and is new enough; a name on the path may be a shim for a version that is not there.
PYTHON := $(shell for p in python3.11 python3 python3.12 python3.13; do \
  $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && command -v $$p && break; done)
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

# The slow tests, then the trial of diagnosis in runs/concealed_effects: hours; stopped and called again, it goes on.
prove: $(STAMP)
	$(BIN)/pytest -n $(WORKERS) --dist loadfile -m slow
	$(BIN)/python -m studies.concealed_effects --workers $(WORKERS)

# Each study writes into runs/studies/; `python -m studies.NAME --help` says more of one. The trial belongs to `make prove`.
STUDIES := $(filter-out concealed_effects,$(patsubst studies/%/__main__.py,%,$(wildcard studies/*/__main__.py))) \
           $(patsubst studies/%.py,%,$(shell grep -l '__name__ == "__main__"' studies/*.py))

studies: $(STAMP)
	@set -e; for study in $(STUDIES); do echo "== $$study"; $(BIN)/python -m studies.$$study; done

# What no Python package brings; installs what is missing where that is allowed. FOR=tests adds what some tests need.
system:
	@.ci/system "$(PYTHON)" $(FOR)

$(STAMP): pyproject.toml
	@.ci/system "$(PYTHON)"
	@test -x $(BIN)/python || "$(PYTHON)" -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) runs dist build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
