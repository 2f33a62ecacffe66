// Reports whether the thread had the TLS memory of its linked library before the first cycle.
#include <dlfcn.h>
#include <link.h>
#include <std_msgs/Float64.h>

#include <rtcf/component.hpp>

#include "thread_locals.hpp"

namespace {

// Uses the loader's list, as any access to a variable would allocate its memory.
bool thisThreadHas(const void* library) {
    struct Search {
        const void* library;
        bool found;
    } search{library, false};
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* data) {
            auto& wanted = *static_cast<Search*>(data);
            // NOLINTNEXTLINE(performance-no-int-to-ptr): the loader returns addresses as numbers
            if (reinterpret_cast<const void*>(info->dlpi_addr) != wanted.library) return 0;
            wanted.found = info->dlpi_tls_data != nullptr;
            return 1;
        },
        &search);
    return search.found;
}

class LinkedThreadLocal final : public rtcf::Component {
    rtcf::Output<std_msgs::Float64> had{this, "had"};
    rtcf::Output<std_msgs::Float64> count{this, "count"};

    bool configure() override {
        Dl_info info{};
        if (dladdr(reinterpret_cast<const void*>(&rtcf_unit_test_count), &info) == 0)
            return fail("not loaded");
        library_ = info.dli_fbase;
        return true;
    }

    void update() override {
        if (count.value().data == 0.0) had.value().data = thisThreadHas(library_) ? 1.0 : 0.0;
        had.publish();
        count.value().data = rtcf_unit_test_count();
        count.publish();
    }

    const void* library_ = nullptr;
};

}  // namespace

RTCF_COMPONENT(LinkedThreadLocal, "Calls a library that keeps numbers by thread")
