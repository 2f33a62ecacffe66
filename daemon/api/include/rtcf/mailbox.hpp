/// @file
/// A request from a service or action callback to update(), and its reply. The callback runs in a
/// thread that is not real-time: it hands over a request and waits. update() finds the request,
/// works on it for as many cycles as it needs, and replies. The real-time side never waits.
///
///     rtcf::Mailbox<double, bool> move{this};  // request: a position; reply: reached or not
///
///     // in update()
///     if (const double* target = move.request(); target != nullptr && there(*target))
///         move.reply(true);
///
///     // in the callback
///     bool reached = false;
///     switch (move.call(request.target, reached, std::chrono::seconds(5))) { … }
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>

#include "rtcf/member_owners.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/slot.hpp"

namespace rtcf {

class Component;

/// Result of a call.
enum class MailStatus {
    Answered,  ///< update() has replied
    TimedOut,  ///< update() has not replied in time; the request is withdrawn
    Ended,     ///< the loop does not run, or it ended before the reply
};

/// Base class of mailboxes of all types. A mailbox is open while its component may be updated.
class MailboxBase {
   public:
    MailboxBase(const MailboxBase&) = delete;
    MailboxBase& operator=(const MailboxBase&) = delete;

    /// @name For the executor; not real-time
    /// @{
    /// Accepts calls from now on. Called before the component's first cycle.
    void open() {
        const std::lock_guard lock(mutex_);
        state_.store(State::Free, std::memory_order_relaxed);
        pending_ = false;
        open_ = true;
        ++run_;
    }
    /// Ends waiting calls with MailStatus::Ended and rejects new ones. Called after the component's
    /// last cycle.
    void close() {
        const std::lock_guard lock(mutex_);
        open_ = false;
        changed_.notify_all();
    }
    /// @}

   protected:
    explicit MailboxBase(Component* owner);
    ~MailboxBase() { detail::endMember(this); }

    /// Waits for the end of all calls. The destructor of the derived class calls it, while request
    /// and reply still exist.
    void finish() {
        std::unique_lock lock(mutex_);
        open_ = false;
        changed_.notify_all();
        changed_.wait(lock, [this] { return callers_ == 0; });
    }

    // The state belongs to one side at a time. A caller sets Free → Asked → Abandoned, and Answered
    // → Free. update() sets Asked → Answered, and Abandoned → Free. So neither side changes a
    // request or a reply while the other reads it.
    enum class State { Free, Asked, Answered, Abandoned };

    /// Hands a request to update() and waits for the reply. One call is active at a time; others
    /// wait, and their timeout includes that wait.
    /// @param ask writes the request; called with the lock held
    /// @param take reads the reply; called with the lock held
    template <typename Ask, typename Take>
    MailStatus exchange(std::chrono::nanoseconds timeout, const Ask& ask, const Take& take) {
        const auto until = std::chrono::steady_clock::now() +
                           std::min<std::chrono::nanoseconds>(timeout, kLongest);
        std::unique_lock lock(mutex_);
        const Caller caller(*this);
        const unsigned run = run_;
        const auto ended = [&] { return !open_ || run_ != run; };
        // The real-time thread must not wake threads up, so callers poll.
        const auto wait = [&](const auto& done) {
            while (!ended() && !done()) {
                const auto now = std::chrono::steady_clock::now();
                if (now >= until) return false;
                changed_.wait_until(lock, std::min(until, now + kPollPeriod));
            }
            return true;
        };
        const auto is = [this](State state) {
            return state_.load(std::memory_order_acquire) == state;
        };
        if (!wait([&] { return !asking_ && is(State::Free); })) return MailStatus::TimedOut;
        if (ended()) return MailStatus::Ended;
        const Turn turn(*this);
        ask();
        state_.store(State::Asked, std::memory_order_release);
        wait([&] { return is(State::Answered); });
        if (run_ != run) return MailStatus::Ended;  // the state belongs to another run
        State asked = State::Asked;
        if (state_.compare_exchange_strong(asked, State::Abandoned, std::memory_order_acq_rel))
            return open_ ? MailStatus::TimedOut : MailStatus::Ended;
        take();
        state_.store(State::Free, std::memory_order_release);
        return MailStatus::Answered;
    }

    std::atomic<State> state_{State::Free};
    const Shared<std::int64_t>* now_;  ///< the component's time
    bool pending_ = false;             ///< update() has a request to which it has not replied

   private:
    friend struct AbiProbe;
    static constexpr std::chrono::milliseconds kPollPeriod{1};
    static constexpr std::chrono::hours kLongest{24 * 365};

    struct Caller {
        explicit Caller(MailboxBase& of) : mailbox(of) { ++mailbox.callers_; }
        ~Caller() {
            --mailbox.callers_;
            mailbox.changed_.notify_all();
        }
        Caller(const Caller&) = delete;
        Caller& operator=(const Caller&) = delete;
        MailboxBase& mailbox;
    };
    struct Turn {
        explicit Turn(MailboxBase& of) : mailbox(of) { mailbox.asking_ = true; }
        ~Turn() {
            mailbox.asking_ = false;
            mailbox.changed_.notify_all();
        }
        Turn(const Turn&) = delete;
        Turn& operator=(const Turn&) = delete;
        MailboxBase& mailbox;
    };

    std::mutex mutex_;
    std::condition_variable changed_;
    bool open_ = false;
    bool asking_ = false;
    unsigned run_ = 0;  // number of calls of open()
    unsigned callers_ = 0;
};

/// Passes requests from callbacks to update(), one at a time. Declare it as a member of the
/// component, and shut the component's services down in stop() or cleanup(), before the mailbox is
/// destroyed.
template <typename Request, typename Reply>
class Mailbox final : public MailboxBase {
   public:
    /// @param owner the component, `this`
    explicit Mailbox(Component* owner) : MailboxBase(owner) {}
    ~Mailbox() { finish(); }

    /// @name In update()
    /// @{
    /// The request that waits for a reply, or null. It is the same one in each cycle until reply(),
    /// or until its caller gives up. Within an update(), it stays and does not change, whatever its
    /// caller does; after reply(), the next request comes in the next update(). Real-time safe,
    /// wait-free.
    const Request* request() noexcept RTCF_NONBLOCKING {
        if (shown_ns_ == *now_) return shown_;
        const State state = state_.load(std::memory_order_acquire);
        if (state == State::Abandoned) state_.store(State::Free, std::memory_order_release);
        pending_ = state == State::Asked;
        if (!pending_) return nullptr;
        shown_ = &requests_[asked_];
        shown_ns_ = *now_;
        return shown_;
    }
    /// Replies to the request of request(); does nothing if there is none. Wait-free; real-time
    /// safe if the assignment of Reply is.
    void reply(const Reply& reply) noexcept {
        if (!pending_ || state_.load(std::memory_order_acquire) != State::Asked) return;
        pending_ = false;
        reply_ = reply;
        shown_ = nullptr;
        shown_ns_ = *now_;
        State asked = State::Asked;
        // If this fails, the caller has just given up; the next request() resets the state.
        state_.compare_exchange_strong(asked, State::Answered, std::memory_order_acq_rel);
    }
    /// @}

    /// Sends a request to update() and waits for the reply. For callbacks of services and actions
    /// and for other threads of the component, any number of them at once. Never call it in a hook:
    /// the loop may wait for the hook. Not real-time.
    /// @param request copied before the call waits
    /// @param reply   set if the result is Answered
    /// @param timeout for other callers and for the reply; at most a year
    MailStatus call(const Request& request, Reply& reply, std::chrono::nanoseconds timeout) {
        const auto ask = [&] {
            asked_ = 1 - asked_;
            requests_[asked_] = request;
        };
        return exchange(timeout, ask, [&] { reply = reply_; });
    }

   private:
    // The executor calls these by MailboxBase.
    using MailboxBase::close;
    using MailboxBase::open;

    // A caller writes the one that update() has not seen last: update() may still use that one.
    std::array<Request, 2> requests_{};
    std::size_t asked_ = 0;
    Reply reply_{};
    const Request* shown_ = nullptr;  // what request() returns at the time shown_ns_
    std::int64_t shown_ns_ = 0;
};

}  // namespace rtcf
