# The tasks of this tree. Each starts on a plain Debian 12 or 13 that has make and
# git: what more it needs is installed with apt first. With RELEASE=trixie (or
# bookworm) on a machine of the other release, it is done in a Debian of that one.
BUILD := build
# Compilers are called by way of ccache where it is installed.
export CMAKE_CXX_COMPILER_LAUNCHER = $(wildcard /usr/bin/ccache)
export CMAKE_BUILD_PARALLEL_LEVEL ?= $(shell nproc)
# Progress: share of the steps done, seconds since the start.
export NINJA_STATUS ?= [%p, %e s] 

tasks := all build demo robot checker test test-long bench bench-rt deb lint
elsewhere := $(filter-out $(shell tools/release codename),$(RELEASE))

.PHONY: $(tasks) dependencies clean help
.NOTPARALLEL:

ifneq ($(elsewhere),)
$(tasks):
	@tools/in-release $(elsewhere) $(MAKE) --no-print-directory $@ RELEASE=
else

all: dependencies build ## build everything into build/ (default)

dependencies:
	@tools/install-dependencies build run

build:
	@cmake -S . -B $(BUILD) -G Ninja
	@cmake --build $(BUILD)

demo: dependencies ## run Fig. 1 of the paper at 2 kHz for 10 s, with ROS nodes talking to it
	@cmake -S . -B $(BUILD) -G Ninja
	@echo "building what the demo needs: some minutes the first time"
	@cmake --build $(BUILD) --target rtcf_demo
	@components/rtcf_examples/demo/demo

robot: dependencies ## run a simulated arm until Ctrl-C, and show it in the browser
	@cmake -S . -B $(BUILD) -G Ninja
	@echo "building the arm and its controllers: some minutes the first time"
	@cmake --build $(BUILD) --target rtcf_robot
	@components/rtcf_arm/show

checker: dependencies ## build the executor that `build/bin/rtcfctl check` runs components in
	@cmake -S . -B $(BUILD)-rtsan -G Ninja -DRTCF_SANITIZE=realtime \
	  -DCMAKE_CXX_COMPILER=clang++-22 -DRTCF_UNITY=OFF
	@cmake --build $(BUILD)-rtsan --target rtcf-executor

test: all ## all checks: lint, unit, sanitizers, integration, packages
	@tools/install-dependencies test
	@tests/run

test-long: all ## the same with soaks, reproducible builds, PREEMPT_RT and the other Debian
	@tools/install-dependencies test-long
	@tests/run --long

bench: all ## measure against HAL, cyclictest and direct calls; HOURS=3: a long run
	@tools/install-dependencies bench
	@tests/bench/run

bench-rt: all ## measure in a PREEMPT_RT machine with instruction-counted time
	@tools/install-dependencies bench-rt
	@tests/bench/run-rt

deb: dependencies ## build the Debian packages into build/deb/
	@tools/build-packages $(BUILD)/deb

lint: all ## format, static checks and types; LINT_ALL=1: clang-tidy on every file
	@tools/install-dependencies test
	@tools/lint

endif

clean: ## remove everything that was built
	rm -rf $(BUILD) build-tsan build-asan build-rtsan

help: ## show this list
	@sed -nE 's/^([a-z-]+):[^#]*## (.*)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18
