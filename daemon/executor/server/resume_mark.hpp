/// @file
/// The file that makes others resume the loop. Each stop removes it, in a thread of its own: the
/// disk may hang, and neither a stop nor its answer waits for one.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace rtcf::executor {

class ResumeMark {
   public:
    /// @param path empty = none, which counts as removed
    explicit ResumeMark(std::string path);
    /// Leaves a disk that hangs to itself.
    ~ResumeMark();
    ResumeMark(const ResumeMark&) = delete;
    ResumeMark& operator=(const ResumeMark&) = delete;

    /// Begins to remove the file. Does not wait. Not real-time safe, as all here.
    void remove();

    struct Removal {
        bool done = true;
        std::string problem;  ///< why the file is still there; of one that is done
    };
    /// The result of the last remove(). Any thread.
    Removal last() const;

   private:
    struct Shared;

    std::shared_ptr<Shared> shared_;  // null without a path
};

}  // namespace rtcf::executor
