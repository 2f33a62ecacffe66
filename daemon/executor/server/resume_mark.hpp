/// @file
/// The file by which rtcfd resumes the loop after a restart. Each stop removes it in a separate
/// thread, so that a hanging disk delays neither the stop nor its answer.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace rtcf::executor {

class ResumeMark {
   public:
    /// @param path empty = no file, which counts as removed
    explicit ResumeMark(std::string path);
    /// Does not wait for a hanging disk.
    ~ResumeMark();
    ResumeMark(const ResumeMark&) = delete;
    ResumeMark& operator=(const ResumeMark&) = delete;

    /// Starts the removal of the file, without waiting. Not real-time safe, like all functions
    /// here.
    void remove();

    struct Removal {
        bool done = true;
        std::string problem;  ///< error of a finished removal; empty = none
    };
    /// The result of the last remove(). Any thread.
    Removal last() const;

   private:
    struct Shared;

    std::shared_ptr<Shared> shared_;  // null without a path
};

}  // namespace rtcf::executor
