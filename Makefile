# Two commands set everything up on a machine that has only Python and make:
#   make demo   environment, install, a diagnosis of data/samples, a report
#   make test   the tests but the long ones: 287 s of processor time, on all cores (make test-all: all)
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: fuzz kill walk faults help install demo demo-nightly test test-all lint types check samples bench studies clean

help:  ## Show the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

install: $(STAMP)  ## Make the environment in .venv and install opamc into it

demo: $(STAMP)  ## Diagnose data/samples; the report's path is printed
	@$(BIN)/opamc diagnose --baseline data/samples/normal --target data/samples/fault \
	  --set joint.gear_ratio=100 --set joint.pole_pairs=5 --out opamc-out --exit-zero
	@echo "open $(CURDIR)/opamc-out/report.html"

demo-nightly: $(STAMP)  ## Three virtual robots, ten nights, one joint that wears: page and alarm
	@$(BIN)/python benchmarks/nightly/cell_logs.py opamc-cell
	@$(BIN)/opamc nightly opamc-cell/cell.yaml --since 2026-03-01 --jobs 0 || test $$? -eq 1
	@echo "open $(CURDIR)/opamc-cell/nightly/index.html"

# processes that tests start need not compile what others have compiled
unexport PYTHONDONTWRITEBYTECODE

# a file's tests stay together for their fixtures, until one core would wait for the other
PYTEST := $(BIN)/python -m pytest -n auto --dist worksteal -q

test: $(STAMP)  ## Run the tests but the long ones, on all cores
	$(PYTEST) -m 'not long'

test-all: $(STAMP)  ## Run all tests, as CI does
	$(PYTEST)

lint: $(STAMP)  ## ruff: lint and format check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)  ## mypy, strict
	$(BIN)/mypy

check: lint types test-all  ## Everything that CI runs

samples: $(STAMP)  ## Record data/samples anew with the virtual testbed
	$(BIN)/opamc simulate --config configs/samples.yaml --seed 20210801 --no-truth-signals \
	  --out data/samples/normal
	$(BIN)/opamc simulate --config configs/samples.yaml --seed 20210801 --no-truth-signals \
	  --first-session 8 --sessions 3 --fault 3 --out data/samples/fault

bench: $(STAMP)  ## Speed, short form: kernels, commands, an hour from segment to score
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	$(BIN)/python benchmarks/chain/kernels.py --quick
	$(BIN)/python benchmarks/commands.py --times 3 --minutes 2
	$(BIN)/python benchmarks/chain/pipeline.py --hours 0.25 0.5 1

fuzz: $(STAMP)  ## 5000 wrong inputs, ten minutes: each a sentence and the right code
	$(BIN)/python tests/reliability/fuzz.py --count 5000 --minutes 10

kill: $(STAMP)  ## 500 kills and interruptions of all commands: whole results, no orphans
	$(BIN)/python tests/reliability/kills.py --count 500

walk: $(STAMP)  ## 40 random walks over what may befall a cell: `opamc nightly` silent nowhere
	$(BIN)/python benchmarks/nightly/nightly_walk.py 9000 40

faults: $(STAMP)  ## Every system call on a command's output failing once (needs a C compiler)
	$(BIN)/python tests/reliability/faults.py --every 1

studies: $(STAMP)  ## The studies behind the documentation's figures; takes hours
	$(BIN)/python benchmarks/chain/itsc.py
	$(BIN)/python benchmarks/chain/thesis_cases.py --write
	$(BIN)/python benchmarks/chain/boundaries.py --write
	$(BIN)/python benchmarks/decision/decision.py
	$(BIN)/python benchmarks/decision/closed_loop.py
	$(BIN)/python benchmarks/decision/rounds.py --anywhere
	$(BIN)/python benchmarks/decision/departures.py
	$(BIN)/python benchmarks/loop.py
	$(BIN)/python benchmarks/panel.py
	$(BIN)/python benchmarks/cause.py --seeds 30 --write

clean:  ## Remove the environment and every output
	rm -rf $(VENV) opamc-out opamc-cell build *.egg-info .pytest_cache .mypy_cache .ruff_cache
