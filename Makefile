# `make demo` and `make test` need Python 3.11 or newer, make, git, 3 GB of disk and a network at the first call, when everything
# else is installed into .venv.

# The first that runs and is new enough; a name on the path may be a shim for a version that is not there.
PYTHON := $(shell for p in python3.11 python3 python3.12 python3.13; do \
  $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && command -v $$p && break; done)
# The newest that runs, for `make test-newest`; empty where it is the same.
NEWEST := $(shell for p in python3.14 python3.13 python3.12 \
    $$(ls -d $${PYENV_ROOT:-$$HOME/.pyenv}/versions/3.1[2-9]*/bin/python3 2>/dev/null | sort -rV); do \
  $$p -c 'import sys, ensurepip; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && command -v $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
WORKERS ?= 2

.PHONY: firmware demo compiled test test-newest lint docs prove mutants studies system clean

demo: $(STAMP) compiled
	$(BIN)/workbench demo

# Compiled rollouts, once for each version on a machine: a minute, which each worker of the tests would spend otherwise.
compiled: $(STAMP)
	@$(BIN)/workbench doctor --compile > /dev/null

# The robot's own program, with gcc-arm-none-eabi alone; image, sizes and the bound of its stack: runs/firmware.
firmware:
	@$(MAKE) --no-print-directory -C firmware

test: lint compiled
	$(BIN)/pytest -n $(WORKERS) --dist loadfile -m "not slow"

# Types and the quick tests once more, with the newest Python here and the newest Drake, numpy and MuJoCo that pyproject.toml allows,
# in an environment of its own. Left out are tests of the search alone: long, and of our own arithmetic.
NEWEST_LEFT_OUT := tests/identify tests/compare tests/experiment tests/diagnose tests/gait tests/studies

test-newest: pyproject.toml
ifeq ($(NEWEST),)
	@echo "no Python newer than 3.11 here: nothing to test that 'make test' does not"
else
	@.ci/install "$(NEWEST)" .venv-newest upgrade
	.venv-newest/bin/mypy --cache-dir .mypy_cache/newest
	.venv-newest/bin/pytest -q -n $(WORKERS) --dist loadfile -m "not slow" $(NEWEST_LEFT_OUT:%=--ignore-glob='%')
endif

# The documentation, into runs/docs; a warning is an error. The theme's notice of its own end (May 2027) is known: pyproject.toml.
docs: $(STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --site-dir runs/docs
	@echo "open runs/docs/index.html"

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python .ci/counts.py

# The slow tests, 100,000 faults in virtual time (runs/rude), then the trial of diagnosis in runs/concealed_effects: hours; stopped and called again, it goes on.
prove: $(STAMP)
	$(BIN)/pytest -n $(WORKERS) --dist loadfile -m slow
	$(BIN)/python -m tests.rude.prove --workers $(WORKERS)
	$(BIN)/python -m studies.concealed_effects --workers $(WORKERS)

# Mutants of the code that decides (modules and tests in pyproject.toml, [tool.mutmut]): five minutes of processor. It works in
# mutants/; called again, it continues. The score and the survivors: docs/validation.md.
mutants: $(STAMP)
	$(BIN)/python -m pip install --quiet "mutmut>=3.8,<4"
	$(BIN)/mutmut run --max-children $(WORKERS)
	$(BIN)/mutmut results

# Each study writes into runs/studies/; `python -m studies.NAME --help` says more of one. The trial belongs to `make prove`;
# learned_gait needs the extra [learn].
STUDIES := $(filter-out concealed_effects replay,$(patsubst studies/%/__main__.py,%,$(wildcard studies/*/__main__.py))) \
           $(filter-out gait_recertify gait_row_seeds learned_gait,$(patsubst studies/%.py,%,$(shell grep -l '__name__ == "__main__"' studies/*.py)))

studies: $(STAMP)
	@set -e; for study in $(STUDIES); do echo "== $$study"; $(BIN)/python -m studies.$$study; done

# What no Python package brings; installs what is missing where that is allowed. FOR=tests adds what some tests need.
system:
	@.ci/system "$(PYTHON)" $(FOR)

$(STAMP): pyproject.toml
	@.ci/system "$(PYTHON)"
	@.ci/install "$(PYTHON)" $(VENV)
	@touch $@

clean:
	rm -rf $(VENV) .venv-newest mutants runs dist build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
