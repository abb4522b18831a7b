# `make demo` and `make test` need nothing but Python 3.11 or later; the rest is for developers.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SMALL := $(VENV)/.ready-small
READY := $(VENV)/.ready
CASES ?= 200
SEED ?= 1
GENERATOR ?= independent
BLIND := $(or $(OUT),runs/blind-$(GENERATOR)-$(SEED)-$(CASES))

.PHONY: demo quick test realtime smoke nightly types mutants coverage-guard control faults soak warm check docs reference readme bench bench-quick blind real bless lock proto layouts schemas clean

demo: $(SMALL)
	@$(BIN)/stickslip run --scenario paper-c45-c45 --log runs/demo.mcap

# linear algebra with one thread a process: there are as many processes as cores. An import of the whole project without kept
# bytecode takes 5.3 s of CPU, with it 2.8 s, and some tests start ten processes.
PARALLEL = OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(NICE) $(BIN)/pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
EACH_CPU_S := 5 # of a test that is not marked slow; 0.3 on a quiet computer
# CPU of all tests of `make quick` and of `make test`: may only fall, but for the 40 s that an issue may add to the second
QUICK_CPU_S := 90
TEST_CPU_S := 950 # 625 on a quiet computer; a busy one takes half as much again

quick: warm ## the unit tests, under a minute once kernels are compiled; what every edit is tried with
	@$(PARALLEL) tests/unit -x -m "not slow and not realtime and not nightly" --cpu-each $(EACH_CPU_S) --cpu-all $(QUICK_CPU_S)

test: $(READY) ## all tests that need no clock
	@$(MAKE) --no-print-directory -j2 check warm
	@$(PARALLEL) -m "not realtime and not nightly" --cpu-all $(TEST_CPU_S)

REALTIME = $(BIN)/pytest --stalls -o cache_dir=.pytest_cache/realtime

realtime: warm ## with the computer to itself; a test that fails is run once more, alone
	@$(REALTIME) -m realtime || { test $$? -eq 1 && $(REALTIME) -m realtime --last-failed; }

smoke: warm ## one minute of `make realtime`; a failure during a stall of the computer is reported and does not count
	@$(BIN)/pytest --excuse-stalls -m smoke

nightly: check types warm bench $(VENV)/.ready-nightly ## everything: an hour or so
	@$(MAKE) --no-print-directory realtime
	@HYPOTHESIS_PROFILE=nightly $(PARALLEL) -m "not realtime"
	@$(MAKE) --no-print-directory coverage-guard control faults

mutants: $(READY) ## ten minutes to an hour: of the changed conditions of the guard at most a tenth may go unnoticed by its unit tests
	@$(NICE) $(BIN)/python -m tests.mutants --report runs/mutants.md

coverage-guard: $(READY) ## every branch of the guard, by its unit tests alone
	@NUMBA_DISABLE_JIT=1 $(BIN)/pytest tests/unit/bridge/guard -p no:cacheprovider --cov=bridge.guard --cov-branch --cov-report=term-missing --cov-fail-under=100

control: $(READY) ## the controller on the whole bank, beside its rivals; fails where a bar is missed
	@$(BIN)/python -m bench control --report runs/control.html --json runs/control.json

faults: $(READY) ## every fault of deploy/faults in simulated time: runs/faults.md
	@mkdir -p runs
	@$(BIN)/python -m bench faults --report runs/faults.md

soak: $(READY) ## one hour of a loop: memory, lost blocks, latency over time: runs/soak.md
	@mkdir -p runs
	@$(BIN)/stickslip soak --hours 1 --report runs/soak.md

warm: $(READY)
	@$(BIN)/python -m tests.warm_up

check: $(READY)
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/ty check --no-progress
	@$(BIN)/lint-imports --no-logo
	@$(MAKE) --no-print-directory docs

types: $(READY) ## the strict check, 100 s of CPU; `make check` has the 6 s of ty
	@$(BIN)/pyright

docs: $(READY) ## the pages as a site in site/, which works from a disk; a dead link is an error
	@$(BIN)/python -m docs.generate
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

reference: $(READY) ## the generated pages of docs/reference, and deploy/zenoh after a change of the roles on the bus
	@$(BIN)/python -m docs.generate

readme: $(READY) ## after a change of what the commands of the README print
	@$(BIN)/python -m docs.readme

bench: $(VENV)/.ready-nightly ## a quarter of an hour, with the machine to itself
	@$(BIN)/python -m tests.speed

bench-quick: $(READY) ## four minutes: no vibrated rig, Radau, MuJoCo, effects; one diagnosis
	@$(BIN)/python -m tests.speed --quick

blind: $(READY) ## hours; what has a result is not done again: make blind CASES=20 SEED=1 OUT=runs/blind GENERATOR=plant
	@test -e $(BLIND) || $(BIN)/python -m tests.blind make --cases $(CASES) --seed $(SEED) --out $(BLIND) \
		--key $(BLIND).key.json --generator $(GENERATOR)
	@$(BIN)/python -m bench blind run $(BLIND)
	@$(BIN)/python -m bench blind score $(BLIND) --key $(BLIND).key.json --baselines --json $(BLIND).json --report $(BLIND).html

real: $(READY) ## some minutes; needs the public logs in ../shared/data: make real OUT=runs/real ARGS="--known"
	@$(BIN)/python -m tests.real --out $(or $(OUT),runs/real) $(ARGS)

# Both installers print each package. An environment that was made for uv has no pip.
define install
@if command -v uv > /dev/null; then uv pip install --python $(BIN)/python --no-deps $(1); \
else $(BIN)/python -m ensurepip > /dev/null && $(BIN)/python -m pip install --disable-pip-version-check --no-compile --no-deps $(1); fi
endef

# some 45 packages: what runs, records, replays and judges
$(SMALL): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if v >= (3, 11) else f"$(PYTHON) is {v[0]}.{v[1]}: stickslip needs Python 3.11 or later; try make PYTHON=python3.11")'
	@echo "making $(VENV), once: 190 MB to download, 600 MB on disk"
	@$(PYTHON) -m venv $$(command -v uv > /dev/null && echo --without-pip) $(VENV)
	$(call install,--require-hashes --requirement requirements.lock)
	$(call install,--no-build-isolation --editable .)
	@touch $@

# some 95 more: the developers' tools
$(READY): $(SMALL) requirements-dev.lock
	@echo "adding the developers' tools to $(VENV), once: 600 MB on disk"
	$(call install,--require-hashes --requirement requirements-dev.lock)
	@touch $@

$(VENV)/.ready-nightly: $(READY) requirements-nightly.lock
	$(call install,--require-hashes --requirement requirements-nightly.lock)
	@touch $@

LOCK = uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet

lock: ## needs uv
	$(LOCK) --extra editable --output-file requirements.lock
	$(LOCK) --extra dev --constraint requirements.lock --output-file requirements-dev.lock
	$(LOCK) --extra bench --extra viewers --constraint requirements-dev.lock --output-file requirements-nightly.lock

proto: $(READY) ## after a change of a .proto file
	$(BIN)/python -m grpc_tools.protoc -I bridge/wire --python_out=bridge/wire --pyi_out=bridge/wire \
		--include_source_info --descriptor_set_out=bridge/wire/stickslip.desc bridge/wire/stickslip.proto
	$(BIN)/python -m grpc_tools.protoc -I bridge/log/viewers --include_imports \
		--descriptor_set_out=bridge/log/viewers/foxglove/Log.desc foxglove/Log.proto

layouts: $(READY) ## after a change of a record that kernels read: its fields for the type checkers
	@$(BIN)/python -m docs.layouts

schemas: $(READY) ## after a change of a format
	$(BIN)/stickslip schema --out deploy/schemas
	$(BIN)/python -m bench.schemas

clean:
	rm -rf $(VENV) runs

bless: $(READY) ## after a wanted change of behaviour: make bless REASON="why"
	@$(BIN)/python -m tests.golden.bless --reason "$(REASON)"
