# Begin with `make demo` or `make test`. Each prepares the machine first (scripts/setup), says what it
# installs, and asks for nothing.
#
#   make demo     precomputes a scene, plays it under a power and an error budget, writes reports to target/demo
#   make test     every test; make test T=stability runs those of that name
#   make build    everything, and nothing else
#   make run      an example: make run EXAMPLE=budget
#   make bench    a benchmark: make bench BENCH=baseline ARGS='--size 320x180'
#   make figures  plays docs/data/records, draws the plots and writes the tables of the documents from docs/data
#   make check    formatting, lints, documentation; warnings are errors
#   make ci       checks and tests, as .ci/run does
#   make clean-demo   removes what the demo wrote

# What the demo shows, and for how long it searches: make demo SIZE=320x180 TIME_LIMIT=20m
SCENE = assets/scenes/courtyard.scene.ron
OUTPUT = target/demo
SIZE = 160x90
FPS = 15
TIME_LIMIT = 4m
# Counted work is the same in every run; METER=nvml and others measure (docs/power.md).
METER = work
# An interrupted search goes on; EXISTING=--overwrite begins anew.
EXISTING = --resume
POWER_BUDGET = 60%
ERROR_BUDGET = 0.02

EXAMPLE = minimal
BENCH = baseline
T =
ARGS =

# One folder for all clones on this machine, so that the demo, the tests and CI share one build of
# Bevy, which takes most of an hour of CPU time. For the same reason every command below says
# --workspace: Cargo unifies features for each selection of packages, and another selection compiles
# another Bevy.
ifneq ($(HOME),)
export CARGO_TARGET_DIR ?= $(HOME)/.cache/frugal-gi/build
else
export CARGO_TARGET_DIR ?= $(CURDIR)/target
endif

FRUGAL = $(CARGO_TARGET_DIR)/debug/frugal

.PHONY: help demo test run bench figures check ci setup build clean-demo

help:
	@sed -n '4,12s/^# *//p' Makefile

setup:
	@scripts/setup

build: setup
	cargo build --workspace
	@echo "Built. Next: make demo, or scripts/run $(FRUGAL) --help."

MAP = $(OUTPUT)/$(patsubst %.scene.ron,%,$(notdir $(SCENE))).pareto.ron
# Meters read the whole machine, so that only with counted work two processes render.
METERED = --meter "$(METER)" $(if $(filter work%,$(METER)),--workers 2)
EVALUATE = scripts/run "$(FRUGAL)" evaluate "$(SCENE)" --map "$(MAP)" $(METERED)

demo: build
	mkdir -p "$(OUTPUT)"
	scripts/run "$(FRUGAL)" precompute "$(SCENE)" --output "$(MAP)" --path tour --size $(SIZE) --fps $(FPS) \
		--time-limit $(TIME_LIMIT) $(METERED) $(EXISTING) --report "$(OUTPUT)/search"
	$(EVALUATE) --record "$(OUTPUT)/tour.record" --power-budget $(POWER_BUDGET) --json "$(OUTPUT)/evaluate-power.json" --report "$(OUTPUT)/power"
	$(EVALUATE) --record "$(OUTPUT)/tour.record" --error-budget $(ERROR_BUDGET) --json "$(OUTPUT)/evaluate-error.json" \
		--report "$(OUTPUT)/error"
	rm -f "$(OUTPUT)/tour.record"
	@echo "Next: open $(OUTPUT)/power/report.html and $(OUTPUT)/error/report.html, then make run EXAMPLE=budget, or put the map into an app (docs/using.md)."

test: setup
	scripts/test $(T)

# At the workspace's root this, too, selects the whole workspace.
run: setup
	scripts/run cargo run --example $(EXAMPLE) -- $(ARGS)

# In the profile of everything else, Bevy is not compiled once more.
bench: setup
	scripts/run cargo bench --workspace --bench $(BENCH) --profile dev -- $(ARGS)

# Bevy-free, so that --workspace is not needed, nor a graphics driver.
EXAMPLES = cargo run --package frugal_search --features testing --example

figures:
	$(EXAMPLES) policies -- --json docs/data/policies.json
	$(EXAMPLES) meters -- --json docs/data/meters.json
	$(EXAMPLES) figures

check: setup
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
	@echo "Clean. Next: make test."

ci:
	.ci/run

clean-demo:
	rm -rf target/demo
