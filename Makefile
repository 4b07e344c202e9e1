# `make` on a fresh machine sets everything up and bakes the default scene; `make help` lists the rest.
# Relative paths only: the path of the checkout may hold a space.

SHELL := /bin/sh
.SHELLFLAGS := -euc
.ONESHELL:
MAKEFLAGS += --no-print-directory

CORES ?= 2
# What check-export looks at.
RESULTS ?= results/fruit_room
# A Python of your choice: make PYTHON=/path/to/python3.12
PYTHON ?=
# What open3d's wheel expects of the system, by the names of Debian and Ubuntu.
SYSTEM_PACKAGES := libusb-1.0-0 libgl1 libegl1 libx11-6 libudev1 libidn2-0
# What the set-up imports to know that those are there.
IMPORT_CHECK := import embreex.rtcore_scene, open3d

# Every recipe that runs something of ours starts with this.
ACTIVATE = PATH="$$PWD/.venv/bin:$$PATH"; export PATH

.PHONY: bake help setup test lint bench accuracy check-export lock clean

bake: setup  ## set up, then bake data/scenes/fruit_room into results/fruit_room (the default)
	@$(ACTIVATE)
	snakemake --cores $(CORES) --rerun-incomplete --quiet rules reason host
	echo
	echo "Report:  results/fruit_room/report.html"
	echo "GLB:     results/fruit_room/scene.glb"

test: setup  ## set up, then run every test (make test ARGS="-m 'not slow'" for the quick ones)
	@$(ACTIVATE)
	python -m pytest $(ARGS)

lint: setup  ## ruff over the code; what snakemake --lint says, counted (it asks for conda, we have one lock file)
	@$(ACTIVATE)
	ruff check .
	snakemake --lint 2>&1 | sed -n 's/^ *\* \(.*\)/\1/p' | sort | uniq -c

bench: setup  ## error against seconds on the two reference scenes, by whole bakes (minutes)
	@$(ACTIVATE)
	python benchmarks/run.py $(ARGS)

accuracy: setup  ## error on hard cases with known answers, into benchmarks/accuracy.md (minutes)
	@$(ACTIVATE)
	python benchmarks/accuracy.py $(ARGS)

check-export: bake  ## the exported files in Khronos' validator and a stock viewer (needs node, npm and Chromium)
	@$(ACTIVATE)
	for tool in node npm; do command -v $$tool > /dev/null || { echo "make: check-export needs $$tool" >&2; exit 1; }; done
	cd tests/browser
	if ! [ node_modules/.package-lock.json -nt package-lock.json ]; then npm ci --no-audit --no-fund --loglevel=error; fi
	cd ../..
	node tests/browser/check.js "$(RESULTS)" "$$PWD/.venv/bin/python"
	RESULTS="$(RESULTS)" python -m pytest tests/browser/check_report.py

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*##/\1\t/p' Makefile | sort

setup:  ## only create .venv from requirements.lock and check the system's libraries
	@wanted="$$(pwd -P) $$(cksum < requirements.lock)"
	packages_done() { [ "$$(cat .venv/packages.stamp 2>/dev/null)" = "$$wanted" ] && .venv/bin/python -c '' 2>/dev/null; }
	system_done() { packages_done && [ -e .venv/system.stamp ]; }
	if system_done; then exit 0; fi
	say() { printf '%s\n' "$$*" >&2; }
	may_install() { [ "$$(id -u)" = 0 ] && command -v apt-get > /dev/null; }
	install() { say "Installing system packages: $$*"; apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq --yes --no-install-recommends "$$@" > /dev/null; }
	command_to_type() { say "    sudo apt-get update && sudo apt-get install --yes --no-install-recommends $$*"; say "(names of Debian and Ubuntu), then run make again."; }
	if [ "$$(uname -sm)" != "Linux x86_64" ]; then
	    say "make: this runs on Linux x86_64 only (open3d-cpu has no other wheels); here is $$(uname -sm)."; exit 1
	fi

	if ! packages_done; then
	    suits() { "$$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2> /dev/null; }
	    python=; bare=
	    for candidate in $(if $(PYTHON),"$(PYTHON)",python3.13 python3.12 python3.11 python3); do
	        if ! suits "$$candidate"; then continue; fi
	        if "$$candidate" -c 'import ensurepip, venv' 2> /dev/null; then python=$$candidate; break; fi
	        bare=$${bare:-$$candidate}
	    done
	    if [ -z "$$python" ] && [ -n "$$bare" ]; then  # Debian and Ubuntu keep venv apart
	        package="$$("$$bare" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
	        if may_install && install "$$package"; then python=$$bare
	        else say "make: $$bare can not make a virtual environment. Type"; command_to_type "$$package" $(SYSTEM_PACKAGES); exit 1
	        fi
	    fi
	    if [ -z "$$python" ]; then
	        say "make: no suitable Python. One of 3.11, 3.12 or 3.13 is needed; tried: $(or $(PYTHON),python3.13 python3.12 python3.11 python3)."
	        say "Install one (on Debian and Ubuntu: sudo apt-get install python3 python3-venv) or name it: make PYTHON=/path/to/python3.12"
	        exit 1
	    fi
	    if [ -e .venv ]; then say "Remaking .venv: it is incomplete, or made for another folder or lock file."; fi
	    say "Setting up .venv with $$("$$python" --version): 107 packages, 300 MB to download the first time."
	    rm -rf .venv
	    "$$python" -m venv .venv
	    pip() { .venv/bin/python -m pip --disable-pip-version-check --no-input "$$@"; }
	    sed -n '/^setuptools==/,/^ *#/p' requirements.lock > .venv/build.lock
	    pip install -qq --no-compile --no-deps --require-hashes -r .venv/build.lock
	    pip install -qq --no-compile --no-deps --require-hashes --no-build-isolation --use-pep517 -r requirements.lock
	    pip check > /dev/null || { pip check >&2; exit 1; }
	    printf '%s\n' "$$wanted" > .venv/packages.stamp
	fi

	check() { .venv/bin/python -c '$(IMPORT_CHECK)' 2> .venv/import.log; }
	if ! check && may_install; then install $(SYSTEM_PACKAGES) || say "make: apt-get failed."; fi
	if ! check; then
	    say "make: $$(tail -n 1 .venv/import.log)"
	    say "open3d needs libraries that this system lacks. Type"; command_to_type $(SYSTEM_PACKAGES); exit 1
	fi
	say "Compiling Python and the inner loops for this machine, once."
	# Where PYTHONDONTWRITEBYTECODE is set, as in many containers, every bake would do it again: 2 CPU s each.
	.venv/bin/python -m compileall -qq -j 0 .venv/lib lib stages || :  # some packages hold templates of Python
	.venv/bin/python -c 'from lib.compiled import compile_all; compile_all()' || say "make: that failed; the first bake will do it."
	touch .venv/system.stamp

lock:  ## write requirements.lock anew from pyproject.toml (needs uv)
	@uv pip compile pyproject.toml --extra dev --python-version 3.11 --python-platform x86_64-manylinux_2_35 \
	    --generate-hashes --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" --quiet \
	    --upgrade --output-file requirements.lock

clean:  ## remove .venv and the caches; results/ stays (remove it by hand)
	@rm -rf .venv .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
	if [ -d results ]; then echo "results/ and .snakemake/ are kept: they hold bakes. Remove them by hand if you mean to."; fi
