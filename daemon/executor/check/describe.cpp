#include "check/describe.hpp"

#include <fmt/format.h>
#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <exception>
#include <memory>
#include <string_view>
#include <system_error>

#include "common/serialized.hpp"
#include "common/thrown.hpp"
#include "messages/to_wire.hpp"
#include "plugins/library.hpp"

namespace rtcf::executor {

namespace {

// Code of components runs from here on, and needs no privileges here.
void dropCapabilities() {
    if (::geteuid() == 0) return;  // a private rtcfd of root: it would stay root anyway
    ::prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0);
    __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
    std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> none{};
    if (::syscall(SYS_capset, &header, none.data()) != 0)
        throw std::system_error(errno, std::generic_category(), "cannot drop capabilities");
}

bool writeToOutput(std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(STDOUT_FILENO, bytes.data(), bytes.size());
        if (count < 0 && errno != EINTR) return false;
        if (count > 0) bytes.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
}

}  // namespace

int describeLibrary(const std::string& library, const std::string& package,
                    const std::vector<uid_t>& owners) {
    v1::LibraryDescription description;
    try {
        dropCapabilities();
        // Never destroyed, because libraries may have static state.
        auto* libraries = new LibraryStore;
        for (const uid_t owner : owners) libraries->trust(owner);
        const auto code = libraries->open(library);
        for (const ComponentRecord* record : code->types()) {
            try {
                const std::unique_ptr<Component> component(record->create(record->type, nullptr));
                *description.add_types() = typeTo(package, library, *record, *component);
            } catch (const std::exception& error) {
                description.set_problem(fmt::format("library {}: constructor of {} threw: {}",
                                                    library, record->type, textOf(error)));
            } catch (...) {
                description.set_problem(
                    fmt::format("library {}: constructor of {} threw an exception of unknown type",
                                library, record->type));
            }
        }
    } catch (const std::exception& error) {
        description.set_problem(textOf(error));
    }
    return writeToOutput(serialized(description)) ? 0 : 1;
}

}  // namespace rtcf::executor
