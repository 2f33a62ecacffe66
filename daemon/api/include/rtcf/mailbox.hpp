/// @file
/// From a service or action callback into update() and back. The callback, in a thread that is not
/// real-time, hands over a request and waits; update() finds it, works on it for as many cycles as
/// it needs, and replies. The real-time side never waits.
///
///     rtcf::Mailbox<double, bool> move{this};               // a position, and whether it was
///     reached … if (const double* target = move.request(); target != nullptr && there(*target))
///     move.reply(true); … bool reached = false;                                 // in the callback
///     switch (move.call(request.target, reached, std::chrono::seconds(5))) { … }
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>

#include "rtcf/realtime.hpp"

namespace rtcf {

class Component;

/// What came of a call.
enum class MailStatus {
    Answered,  ///< the reply is there
    TimedOut,  ///< update() has not replied in time, and does not find the request any more
    Ended,     ///< the loop does not run, or ended before the reply
};

/// What the executor handles of any mailbox: it is open while its component may be updated.
class MailboxBase {
   public:
    MailboxBase(const MailboxBase&) = delete;
    MailboxBase& operator=(const MailboxBase&) = delete;

    /// @name For the executor; not real-time
    /// @{
    void open() {
        const std::lock_guard lock(mutex_);
        state_.store(State::Free, std::memory_order_relaxed);
        open_ = true;
        ++run_;
    }
    /// Who waits is answered. After the component's last cycle.
    void close() {
        const std::lock_guard lock(mutex_);
        open_ = false;
        changed_.notify_all();
    }
    /// @}

   protected:
    explicit MailboxBase(Component* owner);
    ~MailboxBase() = default;

    /// Returns once nobody is in a call any more; while request and reply are still there.
    void finish() {
        std::unique_lock lock(mutex_);
        open_ = false;
        changed_.notify_all();
        changed_.wait(lock, [this] { return callers_ == 0; });
    }

    // Asked, and then one of the others, is what callers and update() tell each other. Callers take
    // it from Free to Asked to Abandoned, update() from Asked to Answered and from Abandoned to
    // Free, so that no request or reply changes under the other's eyes.
    enum class State { Free, Asked, Answered, Abandoned };

    /// One call at a time is asked; others wait for their turn, which their timeout includes.
    /// @param ask, take called with the lock held
    template <typename Ask, typename Take>
    MailStatus exchange(std::chrono::nanoseconds timeout, const Ask& ask, const Take& take) {
        const auto until = std::chrono::steady_clock::now() +
                           std::min<std::chrono::nanoseconds>(timeout, kLongest);
        std::unique_lock lock(mutex_);
        const Caller caller(*this);
        const unsigned run = run_;
        const auto ended = [&] { return !open_ || run_ != run; };
        // The real-time thread wakes nobody up: it is looked at.
        const auto wait = [&](const auto& done) {
            while (!ended() && !done()) {
                const auto now = std::chrono::steady_clock::now();
                if (now >= until) return false;
                changed_.wait_until(lock, std::min(until, now + kLook));
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
        if (run_ != run) return MailStatus::Ended;  // the state is of another run
        State asked = State::Asked;
        if (state_.compare_exchange_strong(asked, State::Abandoned, std::memory_order_acq_rel))
            return open_ ? MailStatus::TimedOut : MailStatus::Ended;
        take();
        state_.store(State::Free, std::memory_order_release);
        return MailStatus::Answered;
    }

    std::atomic<State> state_{State::Free};

   private:
    friend struct AbiProbe;
    static constexpr std::chrono::milliseconds kLook{1};
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
    unsigned run_ = 0;  // of the loop, counted
    unsigned callers_ = 0;
};

/// Requests from callbacks, one at a time. Declared as a member of the component; it outlives the
/// component's services, which are shut down in stop() or cleanup().
template <typename Request, typename Reply>
class Mailbox final : public MailboxBase {
   public:
    /// @param owner the component, `this`
    explicit Mailbox(Component* owner) : MailboxBase(owner) {}
    ~Mailbox() { finish(); }

    /// @name In update()
    /// @{
    /// The request that waits for a reply: the same one in each cycle until reply(), or until its
    /// caller has given it up. Valid for this update(). Real-time safe, wait-free. @return null if
    /// there is none
    const Request* request() noexcept RTCF_NONBLOCKING {
        const State state = state_.load(std::memory_order_acquire);
        if (state == State::Asked) return &request_;
        if (state == State::Abandoned) state_.store(State::Free, std::memory_order_release);
        return nullptr;
    }
    /// Answers it; without a request nothing happens. Wait-free; real-time safe for types whose
    /// assignment is.
    void reply(const Reply& reply) noexcept {
        if (state_.load(std::memory_order_acquire) != State::Asked) return;
        reply_ = reply;
        State asked = State::Asked;
        // Else it has been given up just now, which request() finds.
        state_.compare_exchange_strong(asked, State::Answered, std::memory_order_acq_rel);
    }
    /// @}

    /// Asks update() and waits for its reply. For callbacks of services and actions and other
    /// threads of the component's own, any number of them at once; never in a hook, which the loop
    /// may wait for. Not real-time.
    /// @param reply   filled if Answered
    /// @param timeout of waiting for other callers and for the reply; at most a year
    MailStatus call(const Request& request, Reply& reply, std::chrono::nanoseconds timeout) {
        return exchange(timeout, [&] { request_ = request; }, [&] { reply = reply_; });
    }

   private:
    Request request_{};
    Reply reply_{};
};

}  // namespace rtcf
