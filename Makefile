# `make demo` and `make test` need nothing but Python 3.11 or later; the rest is for developers.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
CASES ?= 200
SEED ?= 1
GENERATOR ?= independent
BLIND := $(or $(OUT),runs/blind-$(GENERATOR)-$(SEED)-$(CASES))

.PHONY: demo quick test test-beside test-realtime test-others nightly mutants coverage-guard control faults soak warm check docs reference bench bench-quick blind real bless lock proto schemas clean

demo: $(READY)
	@$(BIN)/stickslip run --scenario paper-c45-c45 --log runs/demo.mcap

# linear algebra with one thread a process: there are as many processes as cores
PARALLEL = OMP_NUM_THREADS=1 $(NICE) $(BIN)/pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
EACH_CPU_S := 5 # of a test that is not marked slow
QUICK_CPU_S := 110 # of all tests of `make quick`: may only fall; 106 beside other work, with evidence still to be made

quick: warm ## under a minute once kernels are compiled; what every edit is tried with
	@$(PARALLEL) -x -m "not slow and not realtime and not nightly" --cpu-each $(EACH_CPU_S) --cpu-all $(QUICK_CPU_S)

# a cache of its own, as `test-others` writes one at the same time
REALTIME_CACHE = .pytest_cache/realtime
REALTIME = $(BIN)/pytest -m "realtime and not nightly" -o cache_dir=$(REALTIME_CACHE)

test: $(READY) ## what failed in real time beside the others is tried once more, alone: a shared machine pauses for longer than it allows
	@$(MAKE) --no-print-directory -j2 check warm
	@$(MAKE) --no-print-directory -j2 --output-sync=target test-beside test-others
	@! grep -qs true $(REALTIME_CACHE)/v/cache/lastfailed || $(REALTIME) --last-failed

test-beside: ## mostly waits, so that the others take what it leaves; each shows what it has to say at its end
	@$(REALTIME) || test $$? -eq 1

test-realtime:
	@$(REALTIME)

test-others: NICE = nice -n 19
test-others:
	@$(PARALLEL) -m "not realtime and not nightly"

nightly: check warm bench $(VENV)/.ready-viewers ## everything: an hour or so
	@$(BIN)/pytest -m realtime
	@$(PARALLEL) -m "not realtime"
	@$(MAKE) --no-print-directory coverage-guard control faults

mutants: $(READY) ## ten minutes to an hour: of the changed conditions of the guard at most a tenth may go unnoticed by its unit tests
	@$(NICE) $(BIN)/python -m tests.mutants --report docs/quality/mutants.md

coverage-guard: $(READY) ## every branch of the guard, by its unit tests alone
	@NUMBA_DISABLE_JIT=1 $(BIN)/pytest tests/unit/bridge/guard -p no:cacheprovider --cov=bridge.guard --cov-branch --cov-report=term-missing --cov-fail-under=100

control: $(READY) ## the controller on the whole bank, beside its rivals; fails where a bar is missed
	@$(BIN)/stickslip bench control --report runs/control.html --json runs/control.json

faults: $(READY) ## every fault of deploy/faults in simulated time: docs/quality/faults.md
	@$(BIN)/stickslip bench faults --report docs/quality/faults.md

soak: $(READY) ## one hour of a loop: memory, lost blocks, latency over time: docs/quality/soak.md
	@$(BIN)/stickslip soak --hours 1 --report docs/quality/soak.md

warm: $(READY)
	@$(BIN)/python -m tests.warm_up

check: $(READY)
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/pyright
	@$(BIN)/lint-imports --no-logo
	@$(MAKE) --no-print-directory docs

docs: $(READY) ## the pages as a site in site/, which works from a disk; a dead link is an error
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

reference: $(READY) ## after a change of commands, effects, faults or file formats
	@$(BIN)/python -m docs.generate

bench: $(VENV)/.ready-bench ## a quarter of an hour, with the machine to itself
	@$(BIN)/python -m tests.bench

bench-quick: $(READY) ## three minutes: no vibrated rig, Radau, MuJoCo, effects; one diagnosis
	@$(BIN)/python -m tests.bench --quick

blind: $(READY) ## hours; what has a result is not done again: make blind CASES=20 SEED=1 OUT=runs/blind GENERATOR=plant
	@test -e $(BLIND) || $(BIN)/python -m tests.blind make --cases $(CASES) --seed $(SEED) --out $(BLIND) \
		--key $(BLIND).key.json --generator $(GENERATOR)
	@$(BIN)/stickslip blind run $(BLIND)
	@$(BIN)/stickslip blind score $(BLIND) --key $(BLIND).key.json --baselines --json $(BLIND).json --report $(BLIND).html

real: $(READY) ## some minutes; needs the public logs in ../shared/data: make real OUT=runs/real ARGS="--known"
	@$(BIN)/python -m tests.real --out $(or $(OUT),runs/real) $(ARGS)

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if v >= (3, 11) else f"$(PYTHON) is {v[0]}.{v[1]}: stickslip needs Python 3.11 or later; try make PYTHON=python3.11")'
	@echo "setting up $(VENV) (once, about a minute)"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/.ready-bench: $(READY) requirements-bench.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-bench.lock
	@touch $@

$(VENV)/.ready-viewers: $(READY) requirements-viewers.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-viewers.lock
	@touch $@

lock: ## needs uv
	uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -o requirements.lock
	uv pip compile pyproject.toml --extra bench --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements.lock -o requirements-bench.lock
	uv pip compile pyproject.toml --extra viewers --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements.lock -o requirements-viewers.lock

proto: $(READY) ## after a change of bridge/wire/stickslip.proto
	$(BIN)/python -m grpc_tools.protoc -I bridge/wire --python_out=bridge/wire --pyi_out=bridge/wire \
		--include_source_info --descriptor_set_out=bridge/wire/stickslip.desc bridge/wire/stickslip.proto

schemas: $(READY) ## after a change of a format
	$(BIN)/stickslip schema --out deploy/schemas

clean:
	rm -rf $(VENV) runs

bless: $(READY) ## after a wanted change of behaviour: make bless REASON="why"
	@$(BIN)/python -m tests.golden.bless --reason "$(REASON)"
