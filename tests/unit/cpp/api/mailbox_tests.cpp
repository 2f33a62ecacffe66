// Mailboxes: callers in separate threads, update() by hand. No time is asserted: where a caller
// must be in a call, the test waits for its request.
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "rtcf/component.hpp"
#include "rtcf/test.hpp"
#include "support/eventually.hpp"

namespace rtcf::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;

class Idle : public Component {
   public:
    /// Begins an update(), which the test simulates.
    void begin() { accessTo(*this).setTime(time() + 1); }

   private:
    void update() override {}
};

using Box = Mailbox<int, int>;

// As the executor does.
void open(MailboxBase& box) { box.open(); }
void close(MailboxBase& box) { box.close(); }

struct Asked {
    MailStatus status;
    int reply;
};

std::future<Asked> ask(Box& box, int request, nanoseconds timeout = hours(1)) {
    return std::async(std::launch::async, [&box, request, timeout] {
        int reply = -1;
        const MailStatus status = box.call(request, reply, timeout);
        return Asked{status, reply};
    });
}

// Simulates update() in some cycle.
template <typename Box>
bool finds(Idle& idle, Box& box) {
    return eventually([&] {
        idle.begin();
        return box.request() != nullptr;
    });
}

TEST(Mailbox, PassesRequestAndReply) {
    Idle idle;
    Box box(&idle);
    open(box);
    EXPECT_EQ(box.request(), nullptr);
    auto asked = ask(box, 7);
    ASSERT_TRUE(finds(idle, box));
    for (int cycle = 0; cycle < 100; ++cycle) {
        idle.begin();
        ASSERT_NE(box.request(), nullptr) << "the request stays until it is answered";
        EXPECT_EQ(*box.request(), 7);
    }
    box.reply(14);
    EXPECT_EQ(box.request(), nullptr);
    const Asked found = asked.get();
    EXPECT_EQ(found.status, MailStatus::Answered);
    EXPECT_EQ(found.reply, 14);
}

TEST(Mailbox, WithoutALoopTheAnswerIsImmediate) {
    Idle idle;
    Box box(&idle);
    EXPECT_EQ(ask(box, 1).get().status, MailStatus::Ended);
    open(box);
    close(box);
    EXPECT_EQ(ask(box, 1).get().status, MailStatus::Ended);
}

TEST(Mailbox, ACallWithoutAnswerTimesOut) {
    Idle idle;
    Box box(&idle);
    open(box);
    EXPECT_EQ(ask(box, 1, milliseconds(1)).get().status, MailStatus::TimedOut);
    EXPECT_EQ(ask(box, 1, nanoseconds(-1)).get().status, MailStatus::TimedOut);
    idle.begin();
    EXPECT_EQ(box.request(), nullptr) << "the call has timed out";
    box.reply(5);
    auto next = ask(box, 2);
    ASSERT_TRUE(finds(idle, box));
    EXPECT_EQ(*box.request(), 2);
    box.reply(6);
    EXPECT_EQ(next.get().reply, 6) << "not the late answer to another request";
}

TEST(Mailbox, ARequestStaysUntilTheEndOfItsUpdate) {
    Idle idle;
    Box box(&idle);
    open(box);
    auto late = ask(box, 1, milliseconds(20));
    ASSERT_TRUE(finds(idle, box));
    const int* const request = box.request();
    EXPECT_EQ(late.get().status, MailStatus::TimedOut);
    EXPECT_EQ(box.request(), request) << "its caller has given up";
    EXPECT_EQ(*request, 1);
    idle.begin();
    EXPECT_EQ(box.request(), nullptr);
}

TEST(Mailbox, ARequestDoesNotChangeAfterItsReply) {
    Idle idle;
    Box box(&idle);
    open(box);
    auto first = ask(box, 1);
    ASSERT_TRUE(finds(idle, box));
    const int* const request = box.request();
    box.reply(10);
    EXPECT_EQ(first.get().reply, 10);
    EXPECT_EQ(ask(box, 2, milliseconds(5)).get().status, MailStatus::TimedOut);
    EXPECT_EQ(*request, 1) << "the same update() still uses it";
    EXPECT_EQ(box.request(), nullptr) << "the next one comes in the next update()";
    box.reply(20);
    auto third = ask(box, 3);
    ASSERT_TRUE(finds(idle, box));
    EXPECT_EQ(*box.request(), 3);
    box.reply(30);
    EXPECT_EQ(third.get().reply, 30);
}

TEST(Mailbox, AReplyWithoutCallerIsIgnored) {
    Idle idle;
    Box box(&idle);
    open(box);
    box.reply(5);
    auto asked = ask(box, 1);
    ASSERT_TRUE(finds(idle, box));
    box.reply(6);
    EXPECT_EQ(asked.get().reply, 6);
}

TEST(Mailbox, TheEndOfTheLoopAnswersAllCallers) {
    Idle idle;
    Box box(&idle);
    for (int run = 0; run < 3; ++run) {
        open(box);
        std::vector<std::future<Asked>> waiting;
        for (int i = 0; i < 4; ++i) waiting.push_back(ask(box, i));
        ASSERT_TRUE(finds(idle, box));
        close(box);
        for (auto& each : waiting) EXPECT_EQ(each.get().status, MailStatus::Ended);
    }
}

TEST(Mailbox, ANewLoopStartsWithoutRequests) {
    Idle idle;
    Box box(&idle);
    open(box);
    auto before = ask(box, 1);
    ASSERT_TRUE(finds(idle, box));
    close(box);
    open(box);
    auto after = ask(box, 2);
    EXPECT_EQ(before.get().status, MailStatus::Ended);
    ASSERT_TRUE(finds(idle, box));
    EXPECT_EQ(*box.request(), 2);
    box.reply(3);
    EXPECT_EQ(after.get().reply, 3);
}

TEST(Mailbox, ItsDestructionReleasesCallers) {
    Idle idle;
    auto box = std::make_unique<Box>(&idle);
    open(*box);
    auto asked = ask(*box, 1);
    ASSERT_TRUE(finds(idle, *box));
    box.reset();
    EXPECT_EQ(asked.get().status, MailStatus::Ended);
}

// The component is unloaded at the moment of its reply. For AddressSanitizer.
TEST(Mailbox, AReplyOutlivesTheMailbox) {
    const std::string text(200, 'x');  // allocates memory
    for (int i = 0; i < 200; ++i) {
        Idle idle;
        auto box = std::make_unique<Mailbox<int, std::string>>(&idle);
        open(*box);
        auto asked = std::async(std::launch::async, [&to = *box] {
            std::string reply;
            const MailStatus status = to.call(1, reply, hours(1));
            return std::pair(status, reply);
        });
        ASSERT_TRUE(finds(idle, *box));
        box->reply(text);
        close(*box);
        box.reset();
        const auto [status, reply] = asked.get();
        EXPECT_EQ(reply, status == MailStatus::Answered ? text : std::string());
    }
}

// Many callers, some of which time out, while the loop ends and starts: each answer belongs to its
// request.
TEST(Mailbox, AnswersBelongToTheirRequests) {
    Idle idle;
    Mailbox<std::vector<int>, std::vector<int>> box(&idle);
    open(box);
    std::atomic<int> answered{0};
    std::atomic<int> left{4};
    std::vector<std::thread> callers;
    for (unsigned caller = 0; caller < 4; ++caller) {
        callers.emplace_back([&, caller] {
            std::mt19937 random(caller);  // NOLINT(cert-msc32-c,cert-msc51-cpp)
            // All 200 may arrive while it is closed, if the thread that opens it gets no CPU.
            for (int i = 0; i < 200 || answered == 0; ++i) {
                const auto size = static_cast<std::size_t>(random() % 50);
                const std::vector<int> request(size, static_cast<int>(caller) * 1000 + i);
                std::vector<int> reply;
                const auto timeout =
                    random() % 4 == 0 ? nanoseconds(random() % 100'000) : nanoseconds(hours(1));
                if (box.call(request, reply, timeout) != MailStatus::Answered) continue;
                EXPECT_EQ(reply, request);
                ++answered;
            }
            --left;
        });
    }
    std::mt19937 random(99);  // NOLINT(cert-msc32-c,cert-msc51-cpp)
    while (left > 0) {
        idle.begin();
        if (const auto* request = box.request(); request != nullptr && random() % 3 != 0)
            box.reply(std::vector<int>(*request));
        if (random() % 500 == 0) {
            close(box);
            open(box);
        }
        std::this_thread::yield();
    }
    for (std::thread& each : callers) each.join();
    EXPECT_GT(answered, 0);
}

class Doubling final : public Component {
   public:
    Mailbox<int, int> box{this};

   private:
    void update() override {
        if (const int* request = box.request()) box.reply(2 * *request);
    }
};

TEST(Bench, OpensMailboxesWhileTheLoopRuns) {
    Bench doubling("Doubling");
    Box& box = static_cast<Doubling&>(doubling.component()).box;
    EXPECT_EQ(ask(box, 1).get().status, MailStatus::Ended);
    doubling.cycle();
    auto asked = ask(box, 21);
    EXPECT_TRUE(eventually([&] {
        doubling.cycle();
        return asked.wait_for(nanoseconds(0)) == std::future_status::ready;
    }));
    EXPECT_EQ(asked.get().reply, 42);
}

}  // namespace
}  // namespace rtcf::test

RTCF_COMPONENT_NAMED(rtcf::test::Doubling, "Doubling", "Doubles a request", Doubling)
