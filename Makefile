# Two commands: make demo, make test. Everything they need goes into .venv.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: setup demo test soak soak-quick fuzz lint types layers format bench bench-peers protobuf robots goldens dissector constraints clean

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "fri-hil needs Python 3.11 or newer; call make PYTHON=/path/to/python" >&2; exit 1; }
	@echo "setting up $(VENV) with $(PYTHON) (about a minute)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

demo: setup
	$(BIN)/hil demo --out out --seconds 10

# What only computes shares the cores, and so does what mostly waits; what measures time closely has them for itself.
test: setup
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal tests/unit tests/contract tests/golden $(PYTEST_ARGUMENTS)
	$(BIN)/python -m pytest --numprocesses 3 --dist worksteal -m "not alone" tests/network $(PYTEST_ARGUMENTS)
	$(BIN)/python -m pytest -m alone tests/network $(PYTEST_ARGUMENTS)

# About two hours on two cores: ten minutes of a recording replayed to the byte; hours of virtual time under the
# safety laws, with 10 000 reconnects; minutes with real processes, killed, flooded and with a full disk; the proofs of
# docs/safety.md and docs/control.md with many more stories; every property test with twenty times as many cases, and
# other ones each time. make soak-quick is a tenth of it.
SOAK_HOURS ?= 2
SOAK_RECONNECTS ?= 10000
SOAK_MINUTES ?= 6
SOAK_STORIES ?= 20000
SOAK_RECORDING_S ?= 600
SOAK_PROPERTIES ?= 20
soak: setup
	$(BIN)/hil bench replay --seconds $(SOAK_RECORDING_S) --repeats 1
	$(BIN)/python -m tests.soak --virtual-hours $(SOAK_HOURS) --reconnects $(SOAK_RECONNECTS) --real-minutes $(SOAK_MINUTES)
	HIL_SOAK_STORIES=$(SOAK_STORIES) $(BIN)/python -m pytest --numprocesses 2 --timeout 0 \
		tests/unit/test_safety_proof.py tests/unit/test_control_proof.py
	HIL_PROPERTY_SCALE=$(SOAK_PROPERTIES) $(BIN)/python -m pytest --numprocesses 2 --timeout 0 tests/unit

soak-quick: setup
	$(MAKE) soak SOAK_HOURS=0.2 SOAK_RECONNECTS=1000 SOAK_MINUTES=1 SOAK_STORIES=2000 SOAK_RECORDING_S=60 SOAK_PROPERTIES=2

# Two hours: make fuzz SECONDS=7200. What it finds is in out/fuzz/findings, and becomes a test.
SECONDS ?= 120
fuzz: setup
	$(BIN)/python -m pip install --quiet --editable '.[fuzz]'
	$(BIN)/python -m tests.fuzz --seconds $(SECONDS)

lint: setup types layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/mypy

layers: setup
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup
	$(BIN)/hil bench cycle
	$(BIN)/hil bench rate

# Other simulators, in environments of their own: their dependencies are none of ours, and no test needs them.
PEERS := .venv-peers
bench-peers: setup $(PEERS)/franky-sim/.installed $(PEERS)/franka-sim/.installed
	$(BIN)/hil bench peers $(PEERS_ARGUMENTS)

$(PEERS)/%/.installed: tools/bench/peers/%.txt
	$(PYTHON) -m venv $(@D)
	PIP_CONSTRAINT=$(CURDIR)/$< $(@D)/bin/python -m pip install --quiet $*
	@touch $@

# Generated files that are committed; tests compare them with what these commands write.
protobuf: setup
	$(BIN)/python -m tools.make_protobuf

robots: setup
	$(BIN)/python -m tools.make_robots

dissector: setup
	$(BIN)/python -m tools.make_dissector

goldens: setup
	$(BIN)/python -m tools.make_goldens

constraints: setup
	{ head -1 constraints.txt; $(BIN)/python -m pip freeze --all --exclude-editable --exclude pip; } > constraints.new
	mv constraints.new constraints.txt

clean:
	rm -rf $(VENV) $(PEERS) out build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
