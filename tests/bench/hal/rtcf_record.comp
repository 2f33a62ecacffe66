component rtcf_record "Records the duration of each cycle of its thread";
description """
Runs last in the thread, so that it warms no caches for the other functions, and
records HAL's measurement of the previous cycle: the time of the whole thread minus
that of this function; and the time from the deadline of this cycle to its end. Writes
all samples when it is unloaded, "duration end" in ns, a line each.
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
static struct {
    int ticks; /* duration */
    int end_ns; /* since the deadline */
} samples[LIMIT];
static unsigned recorded;
static long long first_ticks, first_ns, last_ticks, last_ns;

static long long now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

FUNCTION(_) {
    const unsigned at = recorded - (unsigned)skip;
    const long long end = now_ns();
    if (at < LIMIT) {
        samples[at].ticks = thread_time - own_time;
        samples[at].end_ns = (int)(end - rtapi_task_pll_get_reference());
    }
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
    for (i = 0; i + (unsigned)skip < recorded && i < LIMIT; i++)
        fprintf(out, "%.1f %d\n", samples[i].ticks * scale, samples[i].end_ns);
    fclose(out);
}
