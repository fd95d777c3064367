# make demo   see moving hair: installs the runtime without torch, bakes the shipped shot, makes a picture and a clip
# make test   installs everything that the tests need, and runs the linter and all tests
# make matrix runs the tests of the extension and of bakes in every supported Blender; installs those that are Python modules
# make addon  builds the Blender extension into dist/
# make native compiles the C files again, for all platforms
# make lowest runs the tests of what needs no torch with the oldest packages that pyproject.toml allows
# PYTHON=/path/to/python3.11 chooses another interpreter (3.11 or newer).

PYTHON ?= python3
VENV   ?= .venv
OUT    ?= out/demo
BIN    := $(VENV)/bin
# Modules are compiled when they are first imported: most of what is installed never is.
PIP_INSTALL = -m pip --disable-pip-version-check install -q --no-compile
INSTALL = $(BIN)/python $(PIP_INSTALL)
# One thread a process: the tests run in two processes, and small matrices only get slower with more. Some images tell
# Python not to keep what it compiles: then each of the hundreds of processes that tests start compiles all it imports.
TESTING = OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=
# A process takes a file at a time. In their own order, the file of all Blenders' scenarios comes early and small ones
# last; by the number of tests, the last would be those of few long tests, and one process would wait for the other.
PYTEST = -m pytest -n 2 --dist loadfile --no-loadscope-reorder -q

.PHONY: demo test lint tests lowest blender matrix addon native bench clean

demo: $(VENV)/installed-demo
	$(BIN)/neuralocks demo -o $(OUT)

test: lint tests

lint: $(VENV)/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check -q .

tests: $(VENV)/installed-test blender
	$(TESTING) $(BIN)/python $(PYTEST)

# "name>=1.2,<2" is "name==1.2" at the least. Old packages warn of newer ones below them, and tidy up
# less well.
FLOORS = $(shell $(BIN)/python -c 'import tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
    print(*(n.split(",")[0].replace(">=", "==") for n in p["dependencies"] + p["optional-dependencies"]["preview"]))')
lowest: $(VENV)/installed-test
	$(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python $(PIP_INSTALL) $(FLOORS) -e ".[test]" onnx
	$(TESTING) .venv-lowest/bin/python $(PYTEST) -W ignore::DeprecationWarning \
	    -W ignore::pytest.PytestUnraisableExceptionWarning \
	    --ignore tests/core/physics --ignore tests/core/training --ignore tests/blender

addon: $(VENV)/installed-test
	$(BIN)/python dcc_addon/build.py

native: $(VENV)/installed-test
	$(BIN)/python -m neuralocks_core.native.build

bench: $(VENV)/installed-test
	$(BIN)/python -m benchmarks

clean:
	rm -rf build dist out .pytest_cache .ruff_cache .hypothesis

$(BIN)/python:
	@command -v "$(PYTHON)" > /dev/null || \
	    { echo "python: there is no $(PYTHON); install 3.11 or newer, or: make PYTHON=/path/to/it"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "python: $$($(PYTHON) --version 2>&1) is too old; install 3.11 or newer, or: make PYTHON=/path/to/it"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed-demo: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) -c constraints.txt -e ".[preview]"
	touch $@

# torch first and by its number: left to the resolver, a newer build with several gigabytes of CUDA would come.
$(VENV)/installed-test: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) "$$(grep '^torch==' constraints.txt)"
	$(INSTALL) -c constraints.txt -e ".[train,body,preview,compare,test]"
	touch $@ $(VENV)/installed-demo

# Blender as a Python module, the oldest and the newest that the extension supports; where the interpreter or the
# wheel is missing, the tests that need it say so and are skipped. Only `make matrix` installs the versions between, 1.3 GB
# each; to it, a missing one is an error. The scenarios of one version take 3:05 to 3:50 minutes of processor time, the other
# tests of all versions 2:12.
BLENDER_NEEDS = onnxruntime usd-core scipy
# The first of that version that really runs: a version manager's stand-in may only say that it does not.
find-python = $(shell for p in python$(1) $(HOME)/.pyenv/versions/$(1)*/bin/python$(1); do \
    if "$$p" -c 0 2>/dev/null; then echo "$$p"; break; fi; done)
PYTHON_3_11 = $(call find-python,3.11)
PYTHON_3_13 = $(call find-python,3.13)

blender: .venv-blender-4.2/installed .venv-blender-5.2/installed

matrix: $(VENV)/installed-test blender .venv-blender-4.5/installed .venv-blender-5.0/installed
	NEURALOCKS_BLENDERS=all $(TESTING) $(BIN)/python $(PYTEST) \
	    tests/blender tests/usd/test_in_blender.py tests/usd/rig/test_in_blender.py

.venv-blender-4.2/installed:
	$(call blender-venv,$(PYTHON_3_11),4.2.23)
.venv-blender-4.5/installed:
	$(call blender-venv,$(PYTHON_3_11),4.5.15)
.venv-blender-5.0/installed:
	$(call blender-venv,$(PYTHON_3_11),5.0.1)
.venv-blender-5.2/installed:
	$(call blender-venv,$(PYTHON_3_13),5.2.3)

define blender-venv
@if [ -z "$(1)" ]; then echo "Blender $(2): its Python is not installed; its tests cannot run"; else \
    echo "Blender $(2): installing into $(@D)"; \
    { [ -d $(@D) ] || $(1) -m venv $(@D); } && \
    { $(@D)/bin/python $(PIP_INSTALL) bpy==$(2) $(BLENDER_NEEDS) && touch $@; } || \
    echo "Blender $(2): could not be installed; its tests cannot run"; fi
endef
