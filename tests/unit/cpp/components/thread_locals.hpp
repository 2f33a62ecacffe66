#pragma once

/// How often the calling thread has called it.
extern "C" double rtcf_unit_test_count();
