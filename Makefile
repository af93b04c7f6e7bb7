# Sanguine: everything from a clean clone. `make help` lists the targets.
#
# Each step leaves a stamp and is skipped while it is current: packages by a hash
# of their pinned lists, the native wheel by the age of its sources.

# Blender 4.2 to 5.0 speak Python 3.11, which is Debian 12's own.
PYTHON ?= /usr/bin/python3.11
# Every Blender module that `make matrix` tests beside the one in .venv.
MATRIX := 4.2.23 5.0.1 5.2.3

# Where `make window` keeps the Debian 13 with Blender 4.3.2 in it.
WINDOW_ROOT ?= .cache/window
# And `make chroots` its bare Debians with `bpy`.
CHROOTS ?= .cache/chroots

VENV := .venv
PY := $(VENV)/bin/python
PIP := $(PY) -m pip install --quiet --disable-pip-version-check
# CMake, Ninja and auditwheel are the pinned ones from the environment.
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)

hash = $(firstword $(shell cat $(1) | sha256sum))
lists = $(1:%=tools/requirements-%.txt)
BUILD_STAMP := $(VENV)/.build-$(call hash,$(call lists,build))
RUN_STAMP := $(VENV)/.run-$(call hash,$(call lists,addon run))
TEST_STAMP := $(VENV)/.test-$(call hash,$(call lists,test docs))
BENCH_STAMP := $(VENV)/.bench-$(call hash,$(call lists,test bench))
NATIVE_STAMP := $(VENV)/.native
ADDON_STAMP := $(VENV)/.addon
OIIO := .cache/openimageio
OIIO_STAMP := $(OIIO)/.fetched-$(call hash,tools/requirements-openimageio.txt tools/fetch_openimageio.py)

# Folders are listed too: their time changes when a file comes or goes.
NATIVE_SOURCES := CMakeLists.txt pyproject.toml addon/blender_manifest.toml \
    $(shell find native -mindepth 1 -name __pycache__ -prune -o -print)

# Two steps that install into one environment must not run side by side.
.NOTPARALLEL:
.DELETE_ON_ERROR:
.PHONY: help demo test soak bench docs pictures native setup openimageio stub extension matrix chroots window clean system

help: ## List the targets
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

demo: setup ## Install what is needed and render the five expressions into out/
	$(VENV)/bin/sanguine render examples/five_expressions.toml --out out

test: setup $(TEST_STAMP) ## Install what is needed and run every test
	cmake --preset default
	cmake --build --preset default
	ctest --preset default
	cmake --preset sanitize
	cmake --build --preset sanitize
	ctest --preset sanitize --parallel $(shell nproc)
	$(PY) -m pytest tests

soak: setup $(TEST_STAMP) ## Look for stacks and skins that break the optics, for an hour or so
	$(PY) -m pytest tests/stability --soak

bench: setup $(BENCH_STAMP) ## Measure what accuracy costs in time (three quarters of an hour, on an idle machine)
	$(VENV)/bin/sanguine bench accuracy
	$(PY) bench/measured_skin.py
	$(PY) bench/inversion.py
	$(PY) bench/measured_people.py
	$(PY) bench/strain.py
	$(PY) bench/blood_colour.py --extremes
	$(PY) bench/emotion_in_time.py
	$(PY) bench/scrubbing.py
	$(PY) bench/cost.py
	$(PY) bench/feature_pictures.py --only times
	$(PY) bench/picture.py
	$(PY) tools/write_docs_tables.py

setup: system $(RUN_STAMP) $(NATIVE_STAMP) $(ADDON_STAMP) ## Install everything that demo needs, render nothing

native: $(NATIVE_STAMP) $(RUN_STAMP) ## Build the native wheel and install it into .venv

openimageio: $(OIIO_STAMP) ## Fetch the libraries and headers of OpenImageIO

docs: setup $(TEST_STAMP) ## Write the pages that follow from the code anew, and the site into build/site
	$(PY) tools/write_parameter_docs.py
	$(PY) tools/write_facs_docs.py
	$(PY) tools/write_skin_presets.py
	$(PY) tools/write_docs_tables.py
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --quiet

pictures: setup $(BENCH_STAMP) ## Make the pictures of docs/ anew: hours, or ONLY=people,strain (tools/pictures.toml lists them)
	$(PY) tools/pictures.py --only "$(ONLY)"

stub: native ## Write the committed stub of the native module anew
	$(PY) -m nanobind.stubgen -m sanguine_core._core -o native/python/sanguine_core/_core.pyi

extension: native ## Build the Blender extension into dist/
	$(PY) tools/build_extension.py

matrix: extension $(TEST_STAMP) ## Run the Blender tests on the other Blender versions
	tools/matrix.sh $(MATRIX)

window: setup extension ## Click through the panel in a real Blender's window (root; WINDOW_ROOT is its Debian 13 folder; KEEP=1: pictures of docs/ anew)
	KEEP=$(KEEP) tools/window/run.sh $(WINDOW_ROOT) out/window $(PARTS)

chroots: setup extension ## Install the zip in bare Debians with three Blenders, cut off from the network (root; ROOMS="bookworm trixie window")
	tools/chroots/run.sh $(CHROOTS) $(WINDOW_ROOT) $(ROOMS)

clean: ## Remove what was built (environments and downloads stay)
	rm -rf build dist out $(NATIVE_STAMP)

system:
	@tools/install_system_packages.sh

$(PY): | system
	$(PYTHON) -m venv $(VENV)

# Every list is complete and installed as it stands: --no-deps.
$(BUILD_STAMP): | $(PY)
	$(PIP) --no-deps --requirement tools/requirements-build.txt
	@rm -f $(VENV)/.build-* && touch $@

$(RUN_STAMP): | $(PY)
	$(PIP) --no-deps --requirement tools/requirements-run.txt
	@rm -f $(VENV)/.run-* && touch $@

$(TEST_STAMP): | $(PY)
	$(PIP) --no-deps --requirement tools/requirements-test.txt --requirement tools/requirements-docs.txt
	@rm -f $(VENV)/.test-* && touch $@

$(BENCH_STAMP): | $(PY)
	$(PIP) --no-deps --requirement tools/requirements-bench.txt
	@rm -f $(VENV)/.bench-* && touch $@

$(OIIO_STAMP): | $(BUILD_STAMP)
	$(PY) tools/fetch_openimageio.py $(OIIO)
	@touch $@

# auditwheel copies the image libraries into the wheel under hashed names, so
# that they never meet Blender's own. It fails if the wheel asks for more than
# glibc 2.34 (std::hypot would: 2.35), which render farms on RHEL 9 have.
$(NATIVE_STAMP): $(NATIVE_SOURCES) $(BUILD_STAMP) $(OIIO_STAMP)
	rm -rf build/raw dist/wheels/sanguine_core-*
	$(PY) -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir build/raw .
	LD_LIBRARY_PATH=$(CURDIR)/$(OIIO)/lib auditwheel repair --plat manylinux_2_34_x86_64 --wheel-dir dist/wheels build/raw/*.whl
	$(PIP) --no-deps --force-reinstall dist/wheels/sanguine_core-*.whl
	@touch $@

$(ADDON_STAMP): addon/pyproject.toml addon/blender_manifest.toml | $(NATIVE_STAMP) $(RUN_STAMP)
	$(PIP) --no-deps --no-build-isolation --editable addon
	@touch $@
