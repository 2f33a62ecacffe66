#include "components/journal.hpp"

extern "C" rtcf_unit_test::Journal* rtcf_unit_test_journal() {
    static rtcf_unit_test::Journal journal;
    return &journal;
}
