#include "server/outside_calls.hpp"

namespace rtcf::executor {

std::uint64_t OutsideCalls::begin() {
    const std::lock_guard lock(mutex_);
    waiting_[next_] = {};
    return next_++;
}

OutsideAnswer OutsideCalls::wait(std::uint64_t call, std::chrono::milliseconds timeout,
                                 const std::atomic<bool>& cancel) {
    constexpr auto kLook = std::chrono::milliseconds(50);  // `cancel` wakes nobody up
    const auto until = std::chrono::steady_clock::now() + timeout;
    std::unique_lock lock(mutex_);
    Waiting& waiting = waiting_[call];
    while (!waiting.answer && !cancel && std::chrono::steady_clock::now() < until) {
        answered_.wait_for(lock, kLook);
    }
    OutsideAnswer answer = waiting.answer.value_or(OutsideAnswer{
        false, cancel ? "the executor is ending"
                      : "rtcfd has not answered in time, but may still act: see rtcfctl status"});
    waiting_.erase(call);
    return answer;
}

void OutsideCalls::sent(std::uint64_t call, std::uint64_t connection) {
    const std::lock_guard lock(mutex_);
    if (const auto found = waiting_.find(call); found != waiting_.end())
        found->second.connection = connection;
}

bool OutsideCalls::answer(std::uint64_t call, OutsideAnswer answer) {
    {
        const std::lock_guard lock(mutex_);
        const auto found = waiting_.find(call);
        if (found == waiting_.end()) return false;
        found->second.answer = std::move(answer);
    }
    answered_.notify_all();
    return true;
}

void OutsideCalls::lost(std::uint64_t connection) {
    {
        const std::lock_guard lock(mutex_);
        for (auto& [call, waiting] : waiting_) {
            if (waiting.connection != connection || waiting.answer) continue;
            waiting.answer = {false, "rtcfd has disconnected; it may have carried out the request"};
        }
    }
    answered_.notify_all();
}

}  // namespace rtcf::executor
