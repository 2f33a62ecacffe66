// A library independent of rtcf. Most of its variants have more thread_local memory than fits into
// static TLS.
#include "thread_locals.hpp"

#ifndef NUMBERS
#define NUMBERS 8192
#endif

namespace {

thread_local double of_this_thread[NUMBERS];

}  // namespace

double rtcf_unit_test_count() { return ++of_this_thread[0]; }
