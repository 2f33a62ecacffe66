/// @file
/// A process started by a test: ends with the object; its lines are read with a deadline.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

class ChildProcess {
   public:
    /// @param environment added to the test's environment
    ChildProcess(const std::vector<std::string>& command,
                 const std::map<std::string, std::string>& environment);
    ~ChildProcess();
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;

    void signal(int number) const;
    /// Kills it and waits for its end.
    void kill();
    /// The next line of its standard output; nothing at its end or after `timeout`.
    std::optional<std::string> line(std::chrono::milliseconds timeout);

   private:
    pid_t pid_ = -1;
    int output_ = -1;
    std::string buffer_;
};
