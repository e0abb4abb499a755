# make demo | lab | test | soak | lint | docs | paper | bench | smoke | package | clean
# Set-up is part of every target: the environment lives in .venv and is made when it is missing or out of date.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PIP_ROOT_USER_ACTION := ignore
# Record sets beside the checkout are used where they are; without them each is fetched when it is asked for by name.
ifneq ($(wildcard ../shared/data),)
export STICKSLIP_DATA ?= $(abspath ../shared/data)
endif

.PHONY: demo lab test soak lint docs paper bench smoke package clean

demo: $(VENV)/.user
	$(BIN)/stickslip demo --output stickslip-demo

lab: $(VENV)/.lab
	$(BIN)/stickslip lab

# Where bytecode is kept, no worker and none of the many processes of the tests has to compile the package anew.
test soak: export PYTHONDONTWRITEBYTECODE :=

test: $(VENV)/.dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

soak: $(VENV)/.dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m soak

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.docs
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

paper: $(VENV)/.user
	$(BIN)/python docs/paper/make.py docs/_build/paper

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/run.py
	$(BIN)/python benchmarks/engine.py
	$(BIN)/python benchmarks/curved.py
	$(BIN)/python benchmarks/motions.py
	$(BIN)/python benchmarks/decay.py
	$(BIN)/python benchmarks/transition.py
	$(BIN)/python benchmarks/microslips.py
	$(BIN)/python benchmarks/rig.py --draws 5
	$(BIN)/python benchmarks/events.py --draws 2
	$(BIN)/python benchmarks/breakaway.py --draws 2
	$(BIN)/python benchmarks/twins.py --draws 2 --twins 12
	$(BIN)/python benchmarks/kills.py
	$(BIN)/python benchmarks/delay.py 5
	$(BIN)/python benchmarks/curves.py 20
	$(BIN)/python benchmarks/law.py --draws 2
	$(BIN)/python benchmarks/laws.py --draws 1 --laws "Coulomb,compliant,state variable"
	$(BIN)/python benchmarks/squeak.py 40
	$(BIN)/python benchmarks/sounds.py --draws 20
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/sweep.py
	$(BIN)/python benchmarks/squeak_model.py
	command -v chromium >/dev/null && $(BIN)/python benchmarks/lab.py || echo "no chromium: the lab is not timed"
	$(BIN)/python benchmarks/lab_data.py
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 SSQ_PARALLEL=0 MALLOC_TOP_PAD_=268435456 \
	  MALLOC_MMAP_THRESHOLD_=17179869184 MALLOC_TRIM_THRESHOLD_=17179869184 $(BIN)/python benchmarks/wavelet.py

smoke: $(VENV)/.dev
	$(BIN)/python tests/smoke.py

package: $(VENV)/.dev
	rm -rf dist
	$(BIN)/python -m build
	$(BIN)/python -m twine check --strict dist/*

clean:
	rm -rf $(VENV) dist build docs/_build stickslip-demo

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.user: pyproject.toml | $(VENV)/bin/python
	@echo "setting up $(VENV)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[io]"
	@touch $@

$(VENV)/.lab: pyproject.toml | $(VENV)/bin/python
	@echo "setting up $(VENV) with what the lab needs"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[io,lab]"
	@touch $@ $(VENV)/.user

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/python
	@echo "setting up $(VENV) with what the tests need"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	@touch $@ $(VENV)/.user $(VENV)/.lab

$(VENV)/.docs: pyproject.toml | $(VENV)/bin/python
	@echo "setting up $(VENV) with what the documentation needs"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[io,docs]"
	@touch $@
