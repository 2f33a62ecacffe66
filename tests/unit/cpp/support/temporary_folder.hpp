/// @file
/// A folder that exists as long as a test.
#pragma once

#include <string>

namespace rtcf::test {

class TemporaryFolder {
   public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    std::string path(const std::string& name) const { return path_ + "/" + name; }

   private:
    std::string path_;
};

}  // namespace rtcf::test
