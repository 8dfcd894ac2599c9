# Everything is one target; `make help` lists them.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
# One thread of linear algebra a process: plugins load numpy before the program could say so.
PYTEST := OMP_NUM_THREADS=1 $(BIN)/pytest
STUDY  ?= reference
ARGS   ?=
SEEDS  ?= test
FOLDER ?= results/blind

.DEFAULT_GOAL := help
.PHONY: help run sweep dataset point compare diagnose improve predict identify paper tutorial template report contrast journal status verify pack s3 bench scale blind soak fuzz slurm docs test clean

help: ## list the targets
	@grep -hE '^[a-z0-9-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z0-9-]+):.*## /\1\t/' | awk -F'\t' '{printf "  make %-9s %s\n", $$1, $$2}'
	@echo "  ARGS passes settings on, for example: make sweep STUDY=smoke ARGS='spindle.preload_n=200 cluster=serial'"

run: $(VENV)/.installed ## set up and compute the reference study: store, figures and report
	$(BIN)/python -m pipeline sweep study=reference $(ARGS)

sweep: $(VENV)/.installed ## compute any study, by STUDY=name
	$(BIN)/python -m pipeline sweep study=$(STUDY) $(ARGS)

dataset: $(VENV)/.installed ## a data set or parameter study, by STUDY=dataset_small (or dataset_overnight, sensitivity, parameter_study)
	$(BIN)/python -m pipeline dataset study=$(if $(filter reference,$(STUDY)),dataset_small,$(STUDY)) $(ARGS)

point: $(VENV)/.installed ## the whole chain at one operating point, by ARGS="spindle_speed_rpm=12000 axial_depth_mm=1"
	$(BIN)/python -m pipeline point $(ARGS)

compare: $(VENV)/.installed ## a model held against a campaign, by CAMPAIGN=DIR
	$(BIN)/python -m pipeline compare campaign=$(CAMPAIGN) $(ARGS)

diagnose: $(VENV)/.installed ## which physical effect is missing in a model, by CAMPAIGN=DIR
	$(BIN)/python -m pipeline diagnose campaign=$(CAMPAIGN) $(ARGS)

improve: $(VENV)/.installed ## diagnose, add what is missing and calibrate again, by CAMPAIGN=DIR
	$(BIN)/python -m pipeline improve campaign=$(CAMPAIGN) $(ARGS)

predict: $(VENV)/.installed ## what a model says of planned cuts, by CAMPAIGN=DIR ARGS="trials=FILE.csv predictions=FILE.csv"
	$(BIN)/python -m pipeline predict campaign=$(CAMPAIGN) $(ARGS)

identify: $(VENV)/.installed ## tip modes from measured receptances, by ARGS="campaign=DIR output=FILE.yaml"
	$(BIN)/python -m pipeline identify $(ARGS)

paper: $(VENV)/.installed ## the paper's findings: figures P1 to P9, and a table of what holds here
	$(BIN)/python -m pipeline paper $(ARGS)

tutorial: $(VENV)/.installed-test ## the improvement of docs/tutorial.md, its pictures into docs/images, and whether it still says what it quotes
	$(BIN)/python -m pipeline improve campaign=docs/examples/paper_campaign base=static_bearing modes=1 \
		output=results/improve-paper_campaign $(ARGS)
	cp results/improve-paper_campaign/figures/history.png docs/images/tutorial_error.png
	cp results/improve-paper_campaign/figures/lobes.png docs/images/tutorial_lobes.png
	TUTORIAL=1 $(PYTEST) -q tests/pipeline/test_tutorial.py

template: $(VENV)/.installed ## an empty measurement campaign to fill in, by ARGS=output=DIR
	$(BIN)/python -m pipeline template $(ARGS)

report: $(VENV)/.installed ## write tables, figures and page of a finished study again, by ARGS=output=DIR
	$(BIN)/python -m pipeline report $(ARGS)

contrast: $(VENV)/.installed ## two studies held against each other, by ARGS="first=DIR second=DIR"
	$(BIN)/python -m pipeline contrast $(ARGS)

journal: $(VENV)/.installed ## what happened in the runs of a study, by ARGS=output=DIR
	$(BIN)/python -m pipeline journal $(ARGS)

status: $(VENV)/.installed ## how far a study is, by ARGS=output=DIR
	$(BIN)/python -m pipeline status $(ARGS)

verify: $(VENV)/.installed ## read a computed study back, by ARGS="output=DIR repair=true"
	$(BIN)/python -m pipeline verify $(ARGS)

pack: $(VENV)/.installed ## a finished study into few files, by ARGS=output=DIR
	$(BIN)/python -m pipeline pack $(ARGS)

s3: $(VENV)/.installed-test ## a study in an object store, on a server of this machine: computed, taken up from elsewhere, read back
	$(BIN)/python -m tests.object_server $(ARGS)

bench: $(VENV)/.installed ## speed and error beside the textbook's method, into results/bench.md
	$(BIN)/python -m benchmarks $(ARGS)

scale: $(VENV)/.installed-test ## what 2 thousand to 200 thousand chunks cost beside the physics, into results/scale (an hour or two; goes on where it was interrupted)
	$(BIN)/python -m benchmarks.scale $(ARGS)

blind: $(VENV)/.installed ## hidden effects diagnosed blind and judged, into FOLDER (many hours; goes on where it was interrupted)
	$(BIN)/python -m benchmarks.blind $(SEEDS) $(FOLDER) $(ARGS)

soak: $(VENV)/.installed-test ## 100 flipped bits of a store found; a study of 2000 chunks killed 20 times and resumed, into results/soak (some minutes)
	FLIPS=100 $(PYTEST) -q tests/pipeline/test_verify.py -k flip
	rm -rf results/soak
	$(BIN)/python -m tests.soak results/soak $(ARGS)

slurm: $(VENV)/.installed-test $(VENV)/.debian ## a study in a job of a SLURM on this machine, cancelled midway, into results/slurm (a minute; takes root)
	rm -rf results/slurm
	$(BIN)/python -m tests.cluster results/slurm

fuzz: $(VENV)/.installed-test ## mutated files and words by the thousand, each read or told in sentences (half an hour)
	FUZZ_EXAMPLES=5000 $(PYTEST) -n 2 tests/property/test_hostile_*.py $(ARGS)

docs: $(VENV)/.installed-docs ## the documentation as pages for a browser, into build/docs; nothing in them is fetched from a network
	$(BIN)/python -m sphinx --fail-on-warning --quiet --fresh-env --doctree-dir build/doctrees docs build/docs
	@echo "open build/docs/index.html"

test: $(VENV)/.installed-test $(VENV)/.debian ## style, types, import contracts and tests (what takes longest of the tutorial: make tutorial)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# While types are checked, what all processes of the tests call is compiled, once.
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.compiling & compiling=$$!; trap "kill $$compiling" INT TERM; \
		$(BIN)/mypy; types=$$?; wait $$compiling && exit $$types
	$(BIN)/lint-imports
	$(PYTEST) -n 4 --dist loadfile --no-loadscope-reorder $(ARGS)

clean: ## remove the environment and caches, keep results
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed, found %d.%d; name one with: make PYTHON=/path/to/python3.12 ..." % sys.version_info[:2])'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[test]'
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	@touch $@ $(VENV)/.installed

# A SLURM, an MPI and a browser to test with, from Debian's packages. Who is not root does without: those tests then say what they need.
PROMPTLY := -o Acquire::http::Timeout=20 -o Acquire::Retries=1
$(VENV)/.debian: | $(BIN)/python
	@if [ "$$(id -u)" = 0 ] && command -v apt-get > /dev/null && ! { command -v slurmctld && command -v mpirun && command -v chromium; } > /dev/null; then \
		{ apt-get -qq $(PROMPTLY) update && DEBIAN_FRONTEND=noninteractive apt-get -qq $(PROMPTLY) install --yes --no-install-recommends \
			slurm-wlm munge openmpi-bin chromium; } > $@.log 2>&1 || echo "no SLURM, MPI or browser to test with, see $@.log"; \
	fi
	@touch $@
