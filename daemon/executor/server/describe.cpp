#include "server/describe.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <exception>
#include <memory>

#include "plugins/library.hpp"
#include "server/convert.hpp"

namespace rtcf::executor {

int describeLibrary(const std::string& library, const std::string& package) {
    v1::LibraryDescription description;
    try {
        // Not destroyed: components may be of a library that has static state of its own.
        const auto* code = new Library(library);
        for (const ComponentRecord* record : code->types()) {
            try {
                const std::unique_ptr<Component> component(record->create(record->type));
                *description.add_types() = typeTo(package, library, *record, *component);
            } catch (const std::exception& error) {
                description.set_problem(fmt::format("library {}: constructor of {} threw: {}",
                                                    library, record->type, error.what()));
            }
        }
    } catch (const std::exception& error) {
        description.set_problem(error.what());
    }
    return description.SerializeToFileDescriptor(STDOUT_FILENO) ? 0 : 1;
}

}  // namespace rtcf::executor
