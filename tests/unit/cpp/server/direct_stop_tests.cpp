#include "server/direct_stop.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "support/connect_to.hpp"
#include "support/temporary_folder.hpp"

namespace rtcf {
namespace {

constexpr std::string_view kStopped = "stopped\n";

// A process that was frozen, or whose thread was starved, finds several requests. Those who then
// see the loop stopped start it again: a request counted later would reject their start.
TEST(DirectStop, CountsAllWaitingRequestsBeforeItStopsTheLoop) {
    constexpr std::size_t kClients = 20;
    const test::TemporaryFolder folder;
    const executor::Access access;
    executor::DirectStop direct_stop(folder.path("stop"), "", access);
    std::vector<int> clients;
    for (std::size_t i = 0; i < kClients; ++i) {
        clients.push_back(test::connectTo(folder.path("stop")));
        ASSERT_EQ(::send(clients.back(), "stop\n", 5, MSG_NOSIGNAL), 5);
    }
    std::atomic<bool> running{true};
    std::vector<std::uint64_t> counts;  // at each stop of the loop
    direct_stop.serve({[&] {
                           counts.push_back(direct_stop.last().count);
                           running = false;
                       },
                       [&] { return running.load(); }});
    for (const int client : clients) {
        std::array<char, 64> buffer{};
        const ssize_t size = ::recv(client, buffer.data(), buffer.size(), 0);
        EXPECT_EQ(
            std::string_view(buffer.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))),
            kStopped);
        ::close(client);
    }
    direct_stop.close();
    EXPECT_EQ(counts, std::vector<std::uint64_t>{kClients});
}

}  // namespace
}  // namespace rtcf
