# Every target first creates a virtual environment in .venv with the packages that it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SEED ?= 1
# Names of sections of `make prove` and `make bench`, which measure all of them without it.
SECTION ?=
# A commit with whose simulation speed `make bench` compares the present one.
AGAINST ?=
# With any value, `make prove` and `make bench` take the smallest sample of each section.
BRIEF ?=
# Folders of the OptiOdom data set, which is not part of this repository.
OPTIODOM ?=
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)

.PHONY: demo test pico ros2 prove bench compiled interpreted packages package lock clean

demo: $(VENV)/installed
	$(BIN)/diffbotctl run pipelines/goal.yaml

# Debian packages: compiler and emulator library, since the tests run the real firmware binary, and
# the browser in which they open the page.
DEBIAN := gcc make gcc-avr avr-libc gcc-arm-none-eabi avrdude libsimavr-dev arduino-core-avr \
  netcat-openbsd iproute2 openssh-client socat dbus-daemon chromium

# Headers of Python, with which the compiled modules are built.
PYTHON_INCLUDE = $(shell $(PYTHON) -c 'import sysconfig; print(sysconfig.get_path("include"))')

packages:
	@dpkg -s $(DEBIAN) >/dev/null 2>&1 || { echo "installing $(DEBIAN)"; \
	  $(SUDO) apt-get update -qq && \
	  $(SUDO) apt-get install -y -qq --no-install-recommends $(DEBIAN) >/dev/null; }
	@test -f "$(PYTHON_INCLUDE)/Python.h" || { echo "installing python3-dev"; \
	  $(SUDO) apt-get update -qq && \
	  $(SUDO) apt-get install -y -qq --no-install-recommends python3-dev >/dev/null; }

# The emulator of a Pico: an npm package, and Node.js if it is not there from another source.
PICO := firmware/emulator/rp2040
pico: $(PICO)/node_modules/.package-lock.json

$(PICO)/node_modules/.package-lock.json: $(PICO)/package-lock.json
	command -v npm >/dev/null || { $(SUDO) apt-get update -qq && \
	  $(SUDO) apt-get install -y -qq --no-install-recommends nodejs npm >/dev/null; }
	npm ci --silent --no-audit --no-fund --prefix $(PICO)
	touch $@

# More processes than cores: many tests wait for a board in real time. A module's tests have one worker, which
# makes its fixtures once.
WORKERS := -n 5 --dist loadscope --no-loadscope-reorder

# Beside the types, one process reads all tests: it leaves their bytecode, which each worker would make otherwise.
# What fails beside other tests runs once more alone: an emulated board for which a slow computer has no time left
# shows nothing about the program. The first failure stays in the output.
test: packages pico $(VENV)/tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m mypy & types=$$!; $(BIN)/python -m pytest --collect-only -qq >/dev/null; wait $$types
	$(BIN)/python -m pytest $(WORKERS) -rsfE || { [ $$? = 1 ] && \
	  $(BIN)/python -m pytest --last-failed --last-failed-no-failures none -rsfE; }

# A separate environment with ROS 2 from third-party wheels (x86-64; Python 3.10 to 3.13; 250 MB), for the
# tests of `diffbotctl ros2` against real nodes. Without it `make test` reports that they did not run. tf2_msgs
# is not among the wheels; it is generated and compiled. `make ros2 ROS_DISTRIBUTION=kilted` makes another
# one, which the tests use when DIFFBOTCTL_ROS2_PYTHON names its Python.
ROS_DISTRIBUTION ?= jazzy
ROS2 := .venv-ros2$(if $(filter-out jazzy,$(ROS_DISTRIBUTION)),-$(ROS_DISTRIBUTION))
ROS2_PACKAGES := rclpy[fastrtps] nav-msgs sensor-msgs std-srvs diagnostic-msgs
ros2: $(ROS2)/installed

$(ROS2)/installed: tests/ros2/build_tf2_msgs.py
	$(PYTHON) -m venv $(ROS2)
	$(ROS2)/bin/python -m pip install -q $(ROS2_PACKAGES:%='ros-$(ROS_DISTRIBUTION)-%') catkin_pkg
	command -v g++ >/dev/null || $(SUDO) apt-get install -y -qq --no-install-recommends g++ python3-dev
	$(ROS2)/bin/python tests/ros2/build_tf2_msgs.py
	touch $@

PROOF = $(if $(BRIEF),--brief) $(if $(SECTION),--section $(SECTION))

# Every figure beside its target; before them the tests with the mark `nightly`, unless BRIEF or SECTION is
# given.
prove: packages pico $(VENV)/tested
	status=0; \
	$(if $(BRIEF)$(SECTION),,$(BIN)/python -m pytest $(WORKERS) -rsfE -m nightly || status=1;) \
	$(BIN)/python -m prove --seed $(SEED) $(PROOF) $(if $(OPTIODOM),--optiodom $(OPTIODOM)) || status=1; \
	exit $$status

bench: $(VENV)/tested
	$(BIN)/python -m prove.bench --seed $(SEED) $(PROOF) $(if $(AGAINST),--against $(AGAINST))

# Compiles the modules in which a simulated run spends its time: the same results, nearly three times as fast.
# Their sources are not read any more: compile again after a change, or go back with `make interpreted`.
compiled: $(VENV)/tested
	$(BIN)/python build_compiled.py

interpreted: $(VENV)/tested
	$(BIN)/python build_compiled.py --remove

# The source distribution and the wheel, in dist/.
package: $(VENV)/tested
	$(BIN)/python -m build --no-isolation --outdir dist .

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV) 2>/dev/null || { \
	  echo "installing python3-venv"; \
	  $(SUDO) apt-get update -qq && $(SUDO) apt-get install -y -qq python3-venv && \
	  rm -rf $(VENV) && $(PYTHON) -m venv $(VENV); }

# Every package has its version and hashes in requirements/, for each Python from 3.11 on. The project itself
# has no hash, and is installed without looking for packages.
LOCKED := $(BIN)/python -m pip install -q --require-hashes -r requirements/
EDITABLE := $(BIN)/python -m pip install -q --no-deps --no-build-isolation -e .

$(VENV)/installed: requirements/run.txt setup.cfg | $(VENV)/bin/python
	$(LOCKED)run.txt
	$(EDITABLE)
	touch $@

$(VENV)/tested: requirements/test.txt setup.cfg | $(VENV)/bin/python
	$(LOCKED)test.txt
	$(EDITABLE)
	rm -rf .mypy_cache  # mypy caches that a package was missing
	touch $@ $(VENV)/installed

# Writes the newest versions that setup.cfg allows, and their hashes, into requirements/. run.txt has what
# `make demo` needs, with setuptools, which installs the project; test.txt has all of test as well.
LOCK := $(VENV)/bin/uv pip compile -q --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --upgrade
lock: | $(VENV)/bin/python
	$(BIN)/python -m pip install -q uv
	echo 'setuptools>=70.1' | $(LOCK) setup.cfg - -o requirements/run.txt
	$(LOCK) setup.cfg --extra test -c requirements/run.txt -o requirements/test.txt

clean:
	find . -maxdepth 1 -name 'diffbotctl__mypyc*.so' -delete
	find diffbotctl -name '*.so' -delete
	rm -rf $(VENV) build dist *.egg-info
