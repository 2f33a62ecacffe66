component rtcf_record "Records the duration of each cycle of its thread";
description """
Runs last in the thread, so that it warms no caches for the other functions, and
records HAL's measurement of the previous cycle: the time of the whole thread minus
that of this function. Writes all samples, one number of ns per line, when it is
unloaded.
""";
pin in s32 thread_time "the thread's time pin, ticks";
pin in s32 own_time "time pin of this function, ticks";
pin out u32 count "cycles recorded";
option singleton yes;
option extra_cleanup yes;
function _ nofp;
license "MIT";
include <stdio.h>;
include <time.h>;
;;
static char *file = "";
RTAPI_MP_STRING(file, "file of the samples");
static int skip = 2000;
RTAPI_MP_INT(skip, "cycles skipped at the beginning");

#define LIMIT 4000000
static int samples[LIMIT];
static unsigned recorded;
static long long first_ticks, first_ns, last_ticks, last_ns;

static long long now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

FUNCTION(_) {
    if (recorded - (unsigned)skip < LIMIT) samples[recorded - (unsigned)skip] = thread_time - own_time;
    if (recorded == 0) {
        first_ticks = rtapi_get_clocks();
        first_ns = now_ns();
    }
    recorded++;
    count = recorded;
}

EXTRA_CLEANUP() {
    unsigned i;
    double scale;
    FILE *out = fopen(file, "w");
    if (!out) return;
    last_ticks = rtapi_get_clocks();
    last_ns = now_ns();
    scale = (double)(last_ns - first_ns) / (double)(last_ticks - first_ticks);
    for (i = 0; i + (unsigned)skip < recorded && i < LIMIT; i++) fprintf(out, "%.1f\n", samples[i] * scale);
    fclose(out);
}
