#!/bin/bash
# In the virtual machine: Fig. 1 in rtcf and in HAL, and cyclictest, at 2 kHz,
# idle and under load. Writes the samples to $OUT.
set -eu
cycles=${CYCLES:-20000}
seconds=$((cycles / 2000))
tar -C / -xf files.tar --skip-old-files
ldconfig
# The first seconds after booting have outliers.
udevadm settle
sleep 5

cyclic() {
  cyclictest --mlockall --threads=1 --affinity=0 --priority=80 --interval=500 \
    --loops="$cycles" --nsecs --verbose >"$OUT/cyclictest.$1"
}

rtcf() { # KIND SPIN_US FILE
  ./bench_paper_run ./rtcf_examples.so 2000 "$seconds" 80 0 "$2" "$OUT/$3.$1" >"$OUT/$3.$1.json"
}

# Started with a high priority, since halcmd's many short processes would wait for the load
# otherwise. HAL's real-time thread has its own priority.
hal() { # KIND COMPONENT COUNTS FILE
  export RTAPI_UID=65534 RTAPI_FIFO_PATH=/tmp/rtapi_fifo
  mkdir -p /tmp/hal
  chmod 777 /tmp/hal
  sed "s,@SAMPLES@,/tmp/hal/samples,; s,@SKIP@,1000,; s,@PERIOD_NS@,500000,; s,@SECONDS@,$seconds,
    s,@COMPONENT@,$2,; s,@COUNTS@,$3," fig1.hal.in >/tmp/fig1.hal
  nice -n -20 halrun /tmp/fig1.hal
  mv /tmp/hal/samples "$OUT/$4.$1"
}

measure() {
  cyclic "$1"
  rtcf "$1" 0 rtcf
  rtcf "$1" 30 rtcf-spin
  [ ! -e fig1.hal.in ] || hal "$1" rtcf_mimo '' hal
  [ ! -e fig1.hal.in ] || hal "$1" rtcf_sum '# ' hal-sums
}

measure idle
stress-ng --quiet --cpu 48 --io 48 --timeout 0 &
stress=$!
trap 'kill "$stress"' EXIT
sleep 2
measure stress-ng
