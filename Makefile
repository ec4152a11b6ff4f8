# Everything runs in .venv, made on first use with nothing but python3 (3.11 or newer) and make.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
TOOLS := .venv/.tools

.PHONY: demo test lint format bench reproduce fuzz audit docs torch lock clean
.DEFAULT_GOAL := demo

define install
	if command -v uv >/dev/null 2>&1; then \
		uv pip install --quiet --python $(BIN)/python $(1); \
	else \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check $(1); \
	fi
endef

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "lumigraph needs Python 3.11 or newer, this is " + sys.version.split()[0])'
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@echo "Installing lumigraph into .venv (once; a minute or so) ..."
	@$(call install,--require-hashes -r requirements.lock)
	@$(call install,--no-deps --no-build-isolation -e .)
	@touch $(READY)

$(TOOLS): requirements-dev.lock $(READY)
	@echo "Installing what tests and checks need into .venv (once) ..."
	@$(call install,--require-hashes -r requirements-dev.lock)
	@touch $(TOOLS)

.venv: $(TOOLS)

demo: $(READY)  ## design, simulate, calibrate, decode, refocus: demo/report.html
	$(BIN)/lumigraph demo

test: $(TOOLS)  ## the whole test suite and the doctests
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadfile -m "not long"

lint: $(TOOLS)  ## format, rules, types, import floors
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

format: $(TOOLS)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(TOOLS)  ## speed against plain SciPy, ratios within one run
	$(BIN)/python -m benchmarks

reproduce: $(TOOLS)  ## the thesis' experiments at full size, and the long tests; resumes what was interrupted
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m long --timeout 1800 tests; \
	tested=$$?; $(BIN)/lumigraph reproduce && exit $$tested

fuzz: $(TOOLS)  ## 100,000 damaged files for every reader, each in a process of its own with bounds on memory and time
	$(BIN)/python tests/fuzz/run.py --count 100000

audit: $(READY)  ## known holes in the locked dependencies; fails where no advisory service answers
	@test -x .venv/audit/bin/pip-audit || { $(PYTHON) -m venv .venv/audit && .venv/audit/bin/pip install -qq --disable-pip-version-check pip-audit; }
	@.venv/audit/bin/pip-audit --strict --disable-pip --require-hashes -r requirements-dev.lock || \
		{ echo "audit: holes are listed above; if none are, the advisory service of PyPI did not answer"; exit 1; }

docs: $(READY)  ## the site, with its gallery: site/index.html; strict, without a network once its tools are there
	@$(BIN)/python -c "import furo, hypothesis, joblib, myst_nb, sphinx_gallery" 2>/dev/null || \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r docs/requirements.lock
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m sphinx -j auto --fail-on-warning --keep-going --quiet -b html docs site

torch: $(READY)  ## optional: PyTorch, so that the array tests run on it too
	@$(BIN)/python -c "import torch" 2>/dev/null || $(BIN)/python -m pip install --quiet --disable-pip-version-check "torch==2.13.0"

COMPILE := uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-emit-find-links \
	--custom-compile-command "make lock" pyproject.toml

lock:  ## compile the three locks again (needs uv); nothing is installed
	$(COMPILE) --extra build -o requirements.lock
	$(COMPILE) --extra build --extra dev --extra video --extra board --constraint requirements.lock -o requirements-dev.lock
	$(COMPILE) --extra docs --constraint requirements-dev.lock -o docs/requirements.lock

clean:
	rm -rf .venv demo reproduce build dist site jupyter_execute docs/gallery docs/reference/api
