# Every target does its own set-up: a virtual environment in .venv, and what it needs in it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SEED ?= 1
ROBOTS ?= 300
TRIALS ?= 50
STARTS ?= 100
BOARD ?= 1
# Robots with planted faults that are calibrated, and how many of them on emulated boards.
FAULTY ?= 30
EMULATED ?= 5
WANDER ?= 50
# Folders of the OptiOdom data set, which does not ship.
OPTIODOM ?=
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)

.PHONY: demo test prove bench packages clean

demo: $(VENV)/installed
	$(BIN)/diffbotctl run pipelines/goal.yaml

# The compiler and the emulator's library, from Debian: the tests run the real firmware binary.
DEBIAN := gcc make gcc-avr avr-libc avrdude libsimavr-dev arduino-core-avr \
  netcat-openbsd openssh-client socat dbus-daemon

packages:
	@dpkg -s $(DEBIAN) >/dev/null 2>&1 || { echo "installing $(DEBIAN)"; \
	  $(SUDO) apt-get update -qq && \
	  $(SUDO) apt-get install -y -qq --no-install-recommends $(DEBIAN) >/dev/null; }

test: packages $(VENV)/tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy diffbotctl
	$(BIN)/python -m pytest -n 3 --dist loadgroup  # more than cores: many tests wait for a board in real time

prove: packages $(VENV)/tested
	$(BIN)/python -m prove --seed $(SEED) --robots $(ROBOTS) --trials $(TRIALS) --starts $(STARTS) \
	  --board $(BOARD) --wander $(WANDER) --faulty $(FAULTY) --emulated $(EMULATED) --optiodom $(OPTIODOM)

bench: $(VENV)/tested
	$(BIN)/python -m prove.bench

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV) 2>/dev/null || { \
	  echo "installing python3-venv, which Debian keeps apart"; \
	  $(SUDO) apt-get update -qq && $(SUDO) apt-get install -y -qq python3-venv && \
	  rm -rf $(VENV) && $(PYTHON) -m venv $(VENV); }

$(VENV)/installed: setup.cfg | $(VENV)/bin/python
	$(BIN)/python -m pip install -q -e .
	touch $@

$(VENV)/tested: setup.cfg | $(VENV)/bin/python
	$(BIN)/python -m pip install -q -e '.[test]'
	rm -rf .mypy_cache  # it remembers packages that were missing
	touch $@ $(VENV)/installed

clean:
	rm -rf $(VENV) build dist *.egg-info
