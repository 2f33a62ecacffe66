// A shared library without components.
extern "C" __attribute__((visibility("default"))) int rtcf_unit_test_unrelated() { return 1; }
