// A shared library that is none of components.
extern "C" __attribute__((visibility("default"))) int rtcf_unit_test_unrelated() { return 1; }
