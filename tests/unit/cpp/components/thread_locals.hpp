#pragma once

/// The number of calls by the calling thread.
extern "C" double rtcf_unit_test_count();
