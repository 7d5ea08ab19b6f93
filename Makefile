# Needs make and Python 3.11 or later; everything else goes into a virtual environment.
#   PYTHON=python3.12   the interpreter that makes it
#   VENV=folder         where it is (.venv)
#   BENCH_ARGS=--quick  a short `make bench`
#   HARD_CASES_ARGS="3 11"      those cases alone
#   FUZZ_ARGS="lf --seconds 600"      one target, ten minutes
#   MUTANTS_ARGS="cameras"      the faults of one area, or of names that begin so with a *
PYTHON ?= python3
VENV ?= .venv
PEER_VENV ?= .venv-peers
PYTEST_ARGS ?= --numprocesses auto --dist worksteal
BENCH_ARGS ?=
HARD_CASES_ARGS ?=
FUZZ_ARGS ?= --jobs 4
MUTANTS_ARGS ?= --jobs 2

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

# `make -f elsewhere/Makefile` works as `make -C elsewhere` does.
ifeq ($(wildcard raytracer/core/compiler/dispatch.py),)
ELSEWHERE = @$(MAKE) --no-print-directory -C "$(dir $(firstword $(MAKEFILE_LIST)))" $@
.PHONY: help
help:
	$(ELSEWHERE)
.DEFAULT:
	$(ELSEWHERE)
else

RT := $(VENV)/bin/rt
VENV_PYTHON := $(VENV)/bin/python
PEER_PYTHON := $(PEER_VENV)/bin/python
INSTALLED := $(VENV)/.installed-by-$(notdir $(PYTHON))
INSTALLED_TEST := $(INSTALLED)-test
INSTALLED_PEERS := $(PEER_VENV)/.installed-by-$(notdir $(PYTHON))
MILLION := scenes/generated/million.ply
FOREST := scenes/generated/forest_russet.npy
DRAGON := scenes/generated/dragon.ply
UMBRELLA := scenes/generated/umbrella_cloth.ply
EVENING := scenes/generated/evening.hdr
STILL_LIFE := scenes/generated/candle.obj
GENERATED := $(MILLION) $(FOREST) $(DRAGON) $(UMBRELLA) $(EVENING) $(STILL_LIFE)

.PHONY: help render test test-slow check bench fuzz mutants peers hard-cases references gallery docs scenes clean

help:  ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1|\2/p' Makefile | while IFS='|' read -r name text; do \
		printf '  make %-12s %s\n' "$$name" "$$text"; done

render: $(INSTALLED)  ## Render the cover scene to outputs/cover.png
	$(RT) render scenes/cover.yaml -o outputs/cover.png

test: check $(GENERATED)  ## Check the sources, run the quick tests, and fuzz for a minute
	$(VENV_PYTHON) -m pytest -m "not slow and not peer" $(PYTEST_ARGS)
	$(VENV_PYTHON) -m tests.fuzz --seconds 60 --jobs 4

test-slow: $(INSTALLED_TEST) $(GENERATED)  ## Run the tests that take minutes
	$(VENV_PYTHON) -m pytest -m "slow and not peer" $(PYTEST_ARGS)

check: $(INSTALLED_TEST)  ## Style, types and layers of the sources
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports --no-logo

fuzz: $(INSTALLED_TEST)  ## Feed the loaders broken files, led by their coverage, for a minute
	$(VENV_PYTHON) -m tests.fuzz $(FUZZ_ARGS)

mutants: $(INSTALLED_TEST) $(GENERATED)  ## Seed faults, one at a time, and see which of them the tests find: hours
	$(VENV_PYTHON) -m tests.mutants $(MUTANTS_ARGS)

bench: $(INSTALLED) $(GENERATED)  ## Measure the speed, against Mitsuba 3 too once `make peers` has installed it
	$(VENV_PYTHON) bench/bench.py $(if $(wildcard $(PEER_PYTHON)),--peer $(PEER_PYTHON)) $(BENCH_ARGS)

peers: $(INSTALLED) $(INSTALLED_PEERS) $(MILLION)  ## Compare with Mitsuba 3, which this installs
	$(VENV_PYTHON) bench/peers/compare.py --peer $(PEER_PYTHON)

hard-cases: $(INSTALLED_TEST) $(GENERATED)  ## Measure what the naive way gets wrong and we do, into docs/hard-cases-table.md
	$(VENV_PYTHON) -m tests.hard_cases $(HARD_CASES_ARGS)

references: $(INSTALLED) $(GENERATED)  ## Render the reference images of the tests anew
	$(RT) reference tests/references/*.npz

gallery: $(INSTALLED) $(GENERATED)  ## Render the pictures in docs/gallery
	$(VENV_PYTHON) docs/make_gallery.py
	$(VENV_PYTHON) docs/make_strips.py
	$(VENV_PYTHON) docs/make_tutorial.py
	$(VENV_PYTHON) docs/make_thumbnails.py
	$(VENV_PYTHON) -m tests.hard_cases.pictures

docs: $(INSTALLED_TEST)  ## Write the reference from the code, draw the diagrams, and build the site into outputs/site
	$(VENV_PYTHON) docs/make_scenes.py
	$(VENV_PYTHON) docs/make_commands.py
	$(VENV_PYTHON) docs/make_python_reference.py
	$(VENV_PYTHON) docs/make_warnings.py
	$(VENV_PYTHON) docs/make_python_api.py
	$(VENV_PYTHON) docs/make_tree.py
	$(VENV_PYTHON) docs/make_diagrams.py
	$(VENV_PYTHON) -m sphinx -q -W --keep-going -b html docs outputs/site

scenes: $(GENERATED)  ## Make the scene files that are not in the repository

clean:  ## Remove what make and the tools made
	rm -rf .venv .venv-peers build dist raytracer.egg-info scenes/generated outputs/cover.png
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find raytracer tests scenes docs -name __pycache__ -type d -prune -exec rm -rf {} +

$(MILLION): scenes/generate/million.py | $(INSTALLED)
	$(VENV_PYTHON) scenes/generate/million.py

$(DRAGON): scenes/generate/dragon.py | $(INSTALLED)
	$(VENV_PYTHON) scenes/generate/dragon.py

$(EVENING): scenes/generate/sky.py | $(INSTALLED)
	$(VENV_PYTHON) scenes/generate/sky.py

# The last file of each stands for all that its script writes.
$(FOREST): scenes/generate/forest.py | $(INSTALLED)
	$(VENV_PYTHON) scenes/generate/forest.py

$(UMBRELLA): scenes/generate/umbrella.py | $(INSTALLED)
	$(VENV_PYTHON) scenes/generate/umbrella.py

$(STILL_LIFE): scenes/generate/still_life.py | $(INSTALLED)
	$(VENV_PYTHON) scenes/generate/still_life.py

# Make the environment $(1) with $(PYTHON), or say in a sentence why that cannot be.
define make_venv
@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	|| { echo "rt needs Python 3.11 or later, and $(PYTHON) is not that: make PYTHON=python3.12 names another" >&2; exit 1; }
@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null \
	|| { echo "$(PYTHON) cannot make virtual environments with pip: install its venv package (python3-venv on Debian and Ubuntu)" >&2; exit 1; }
@test ! -e "$(1)/bin/python" || "$(1)/bin/python" -c 'import sys; sys.exit("%d.%d" % sys.version_info[:2] != sys.argv[1])' \
	"$$($(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')" \
	|| { echo "$(1) was made by another Python than $(PYTHON): remove it first (make clean), or give another VENV" >&2; exit 1; }
$(PYTHON) -m venv "$(1)"
endef

# Installed as links to the sources, so only new requirements need a new installation.
$(INSTALLED): pyproject.toml
	$(call make_venv,$(VENV))
	$(VENV_PYTHON) -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(INSTALLED_TEST): pyproject.toml $(INSTALLED)
	$(VENV_PYTHON) -m pip install --quiet --disable-pip-version-check --editable ".[test]"
	@touch $@

$(INSTALLED_PEERS): Makefile
	$(call make_venv,$(PEER_VENV))
	$(PEER_PYTHON) -m pip install --quiet --disable-pip-version-check mitsuba numpy pyyaml
	@touch $@

endif
