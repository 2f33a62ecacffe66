# The tasks of this tree. Each starts on a plain Debian 12 or 13 that has make and
# git: what more it needs is installed with apt first. With RELEASE=trixie (or
# bookworm) on a machine of the other release, it is done in a Debian of that one.
BUILD := build
# SYMBOLS=ON: gdb shows variables, too.
SYMBOLS := OFF
configure = tools/configure $(BUILD) -DRTCF_SYMBOLS=$(SYMBOLS)
# Compilers are called by way of ccache where it is installed.
export CMAKE_CXX_COMPILER_LAUNCHER = $(shell command -v ccache)
# One cache for this tree and the packages, which are built in another folder and locale.
export CCACHE_BASEDIR = $(CURDIR)
export CCACHE_SLOPPINESS = locale
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

# Before the build, which uses the compiler cache that the tests need.
dependencies-%:
	@tools/install-dependencies build run $*

build:
	@$(configure)
	@cmake --build $(BUILD)

demo: dependencies ## run Fig. 1 of the paper at 2 kHz for 10 s, with ROS nodes talking to it
	@$(configure)
	@echo "building what the demo needs: some minutes the first time"
	@cmake --build $(BUILD) --target rtcf_demo
	@components/rtcf_examples/demo/demo

robot: dependencies ## run a simulated arm until Ctrl-C, and show it in the browser
	@$(configure)
	@echo "building the arm and its controllers: some minutes the first time"
	@cmake --build $(BUILD) --target rtcf_robot
	@components/rtcf_arm/show

checker: dependencies ## build the executor that `build/bin/rtcfctl check` runs components in
	@tools/configure $(BUILD)-rtsan -DRTCF_SANITIZE=realtime
	@cmake --build $(BUILD)-rtsan --target rtcf-executor

test: dependencies-test build ## all checks; ONLY=changed (or files): those that a change may have broken
	@tests/run $(if $(ONLY),--only $(ONLY))

test-long: dependencies-test-long build ## the same with soaks, reproducible builds, PREEMPT_RT and the other Debian
	@tests/run --long

bench: dependencies-bench build ## measure against HAL, cyclictest and direct calls; HOURS=3: a long run
	@tests/bench/run

bench-rt: dependencies-bench-rt build ## measure in a PREEMPT_RT machine with instruction-counted time
	@tests/bench/run-rt

deb: dependencies ## build the Debian packages into build/deb/
	@tools/build-packages $(BUILD)/deb

lint: dependencies-test build ## format, static checks and types; LINT_ALL=1: clang-tidy on every file
	@tools/lint

endif

clean: ## remove everything that was built
	rm -rf $(BUILD) build-tsan build-asan build-rtsan

help: ## show this list
	@sed -nE 's/^([a-z-]+):[^#]*## (.*)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18
