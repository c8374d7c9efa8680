# Everything runs in .venv, which the first target that needs it creates and fills under
# requirements/constraints.txt; it is filled again when that file or pyproject.toml changes. RLlib needs another
# Gymnasium and has an environment of its own, .venv-rllib, BenchMARL another TorchRL: .venv-benchmarl.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python -m
STAMP := $(VENV)/installed-
VENV_RLLIB := .venv-rllib
VENV_BENCHMARL := .venv-benchmarl
STYLE := $(RUN) ruff check . && $(RUN) ruff format --check . && $(VENV)/bin/lint-imports --no-cache
WARM := $(RUN) entropy_explore_env warm --processes 1

.PHONY: help demo new-user docs docs-links test test-long boundscheck test-rllib test-benchmarl lint bench policy \
	predictor reliability night reproduce clean
.NOTPARALLEL:

help:
	@echo "make demo         three robots map an office by the strategy recommended, shown in results/demo;"
	@echo "                  make demo STRATEGY=gradient: by another one"
	@echo "make new-user     all that a new user does, in an environment of its own: half an hour"
	@echo "make docs         the documentation site, into docs/build/html"
	@echo "make docs-links   whether its links to other sites lead somewhere"
	@echo "make test         lint, then the tests"
	@echo "make test-long    also the long ones, and more and other drawn examples: an hour"
	@echo "make boundscheck  the kernels' own tests, with every index checked"
	@echo "make test-rllib   the tests of the trainer with RLlib"
	@echo "make test-benchmarl   the tutorial with BenchMARL"
	@echo "make lint         ruff, pyright and the contracts of imports"
	@echo "make bench        speed against peers"
	@echo "make predictor    trains the networks that predict maps: an hour and a half of a processor"
	@echo "make policy       searches weights of the planner's features: one to three hours of two processors"
	@echo "make reliability  all proofs, into docs/results/reliability.md: many hours"
	@echo "make night        some minutes of each proof, other cases every night"
	@echo "make reproduce    the experiments of the five papers, into docs/results: many hours"
	@echo "make clean        remove the environments, builds and caches; results stay"

# The alias `best` stands for the strategy that is recommended.
STRATEGY ?= best

demo: $(STAMP)baselines
	$(RUN) baselines.run office --strategy $(STRATEGY) --robots 3 --seed 0 --out results/demo

# In a temporary folder, with everything downloaded anew; NEW_USER="--borrow" takes what is installed here.
new-user: $(STAMP)test
	$(RUN) tests.new_user $(NEW_USER)

docs: $(STAMP)docs
	$(RUN) sphinx -b html -W --keep-going -q docs docs/build/html
	@echo "docs/build/html/index.html is the site's first page"

docs-links: $(STAMP)docs
	$(RUN) sphinx -b linkcheck -q docs docs/build/links

# The environments' kernels are compiled once, by one process, while pyright has the other core.
test: $(STAMP)dev
	$(STYLE)
	$(RUN) pyright & types=$$!; $(WARM) && wait $$types
	$(RUN) pytest -n auto --maxprocesses 4 --dist worksteal

test-long: $(STAMP)dev
	$(RUN) pytest -n auto --maxprocesses 4 --dist worksteal -m "long or not long" --hypothesis-profile=long

# Checks are part of what compiled kernels are named after: those without stay as they are.
boundscheck: $(STAMP)dev
	NUMBA_BOUNDSCHECK=1 $(RUN) pytest -n auto --maxprocesses 4 --dist worksteal \
		tests/belief tests/prediction tests/robots tests/viewpoints tests/frontiers tests/planner tests/missions \
		tests/baselines/strategies

test-rllib: $(VENV_RLLIB)/installed
	$(VENV_RLLIB)/bin/python -m pytest tests/training/rllib tests/training/test_rllib_refusals.py

test-benchmarl: $(VENV_BENCHMARL)/installed
	$(VENV_BENCHMARL)/bin/python -m pytest tests/training/test_examples.py -k mappo

lint: $(STAMP)dev
	$(STYLE)
	$(RUN) pyright

bench: $(STAMP)training $(STAMP)bench
	$(RUN) benchmarks.speed

# A stopped search goes on; what it finds is runs/weights/weights.json.
policy: $(STAMP)training
	$(RUN) training.search --tasks office:1 office:3 hybrid:1 --rounds 8 --pairs 30 --out runs/weights

# The predictors of maps that come with the library; a stopped run goes on. Dungeons are fetched.
predictor: $(STAMP)training
	$(RUN) training.map_predictor --missions 90 --validation-missions 12 --epochs 26 --threads 1 --device cpu --out runs/map-predictor
	$(RUN) training.map_predictor --recipes cave office-3d --missions 90 --validation-missions 12 --epochs 26 --device cpu --out runs/volumes

reliability: $(STAMP)dev
	$(RUN) benchmarks.proofs --full --out docs/results/reliability.md

# Other cases every night; the exit code is 1 where one failed.
night: $(STAMP)dev
	$(RUN) benchmarks.proofs --first $$(date -u +%Y%m%d)000 --out results/night/proofs.md

reproduce: $(STAMP)baselines
	for paper in rocha04 rochami bhattacharya sawhney sujan; do \
		$(RUN) baselines.papers $$paper --out docs/results || exit 1; done

# PyTorch's CPU build, unless there is an NVIDIA GPU: pip's own index brings gigabytes of CUDA libraries on Linux.
# Where PyTorch's index cannot be reached, pip's own one serves. $(1): python, $(2): the file with the pin.
CPU_INDEX := https://download.pytorch.org/whl/cpu
define cpu_torch
@command -v nvidia-smi >/dev/null 2>&1 || $(1) -m pip install -qq --disable-pip-version-check --no-deps \
	--retries 0 --timeout 15 --index-url $(CPU_INDEX) $$(grep -o '^torch==[0-9.]*' $(2)) 2>/dev/null \
	|| echo "$(CPU_INDEX) is not reached: PyTorch comes from pip's own index" >&2
endef

# The stamp .venv/installed-EXTRA says that the package is installed with that extra.
$(STAMP)%: pyproject.toml requirements/constraints.txt
	@$(RUN) pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(VENV)
	@echo "installing entropy_explore_env[$*] in $(VENV), a minute or two the first time ..." >&2
	$(if $(filter training test dev,$*),$(call cpu_torch,$(VENV)/bin/python,requirements/constraints.txt))
	@$(RUN) pip install -qq --disable-pip-version-check -c requirements/constraints.txt -e ".[$*]"
	@touch $@

# Environments beside .venv, each with an extra whose pins contradict the others'.
.venv-%/installed: pyproject.toml requirements/constraints-%.txt
	@$(@D)/bin/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(@D)
	@echo "installing entropy_explore_env[$*] in $(@D), a minute or two the first time ..." >&2
	$(call cpu_torch,$(@D)/bin/python,requirements/constraints-$*.txt)
	@$(@D)/bin/python -m pip install -qq --disable-pip-version-check \
		-c requirements/constraints-$*.txt -e ".[$*]" "pytest>=8.2" "hypothesis>=6.100"
	@touch $@

clean:
	rm -rf $(VENV) $(VENV_RLLIB) $(VENV_BENCHMARL) build dist docs/build docs/scenarios *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
