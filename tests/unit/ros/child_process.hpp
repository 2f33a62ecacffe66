/// @file
/// A process started by a test: ended with the object, its lines read with a deadline.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

class ChildProcess {
   public:
    /// @param environment added to that of the test
    ChildProcess(const std::vector<std::string>& command,
                 const std::map<std::string, std::string>& environment);
    ~ChildProcess();
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;

    void signal(int number) const;
    /// Ends it at once and waits for it.
    void kill();
    /// The next line of its standard output; nothing at its end or after `timeout`.
    std::optional<std::string> line(std::chrono::milliseconds timeout);

   private:
    pid_t pid_ = -1;
    int output_ = -1;
    std::string buffer_;
};
