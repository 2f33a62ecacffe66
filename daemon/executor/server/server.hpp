/// @file
/// The server of the executor's socket. On the main thread, it answers queries at once from the
/// graph view, hands changes to the graph thread and sends their answers later, and forwards log
/// records and events. A slow hook delays changes, but never a query.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "logging/log.hpp"
#include "runner/runner.hpp"
#include "server/connection.hpp"
#include "server/direct_stop.hpp"
#include "server/listen.hpp"
#include "server/outside_calls.hpp"
#include "server/statistics_report.hpp"
#include "streams/port_streams.hpp"

namespace rtcf::executor {

class Server {
   public:
    /// Listens on `socket_path` and handles SIGTERM and SIGINT.
    /// @throws std::system_error
    explicit Server(const std::string& socket_path);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    /// @name Any thread: sends a message to all connected rtcfd, or keeps it for the next one
    /// @{
    void publish(const LogEntry& entry);
    void publish(const RunnerEvent& event);
    /// @}
    /// Makes serve() look for messages and direct stops. Any thread.
    void wakeUp() const;

    /// Sends a request of a peer outside to rtcfd and waits for the answer. Any thread but that of
    /// serve(); returns soon after `cancel` becomes true.
    OutsideAnswer ask(const OutsideCall& call, const std::atomic<bool>& cancel);

    /// Serves until an `exit` request or a signal.
    /// @param runner outlives the call
    /// @param access receives the rules from rtcfd
    /// @param direct_stop source of the stops that rtcfd is informed of
    void serve(Runner& runner, Log& log, Access& access, const DirectStop& direct_stop);
    /// Sends queued messages. After serve(), for log records of the shutdown.
    void deliver();

   private:
    struct Outgoing {
        std::uint64_t connection;  // 0 = all
        v1::Response response;
        bool last;  // the last response to its request
    };

    void post(std::uint64_t connection, v1::Response response, bool last);
    void tellStops();
    bool tellStop(Connection& connection);
    void handOn(const v1::Response& call);
    void accept();
    void receive(Connection& connection);
    void drop(std::uint64_t id);
    void respond(std::uint64_t connection, const v1::Response& response);
    void handle(Connection& connection, const v1::Request& request);
    bool answerQuery(std::uint64_t connection, const v1::Request& request);
    void submitChange(std::uint64_t connection, const v1::Request& request);
    void requireStopsKnown(const v1::Request& request) const;
    void submitProbe(std::uint64_t connection, const v1::Request& request);
    void beginWatch(std::uint64_t connection, const v1::Request& request);
    void endWatches(const std::vector<std::uint64_t>& watches);
    void servePorts();
    void expire();
    bool orphaned();
    ::rtcf::v1::RunnerStatus status() const;
    RunningHook stuck() const;
    std::string stuckText(const RunningHook& hook) const;
    void requireNotStuck() const;
    void reportStuck();

    Listener listener_;
    int signals_ = -1;
    int wake_ = -1;
    bool exiting_ = false;
    bool had_daemon_ = false;
    std::int64_t alone_since_ns_ = 0;
    std::int64_t reported_stuck_ns_ = 0;   // the begin of the last stuck hook that was reported
    std::atomic<bool> configured_{false};  // by rtcfd; set by the graph thread
    Runner* runner_ = nullptr;
    Log* log_ = nullptr;
    Access* access_ = nullptr;
    const DirectStop* direct_stop_ = nullptr;
    std::uint64_t next_id_ = 1;
    std::map<std::uint64_t, std::unique_ptr<Connection>> connections_;
    std::unique_ptr<StatisticsReport> statistics_;

    // Requests queued for the graph thread, by connection and id, with their timeouts.
    struct Waiting {
        std::int64_t until_ns;
        std::function<v1::Response(const RunningHook& stuck)> otherwise;
        std::shared_ptr<std::atomic<bool>> given_up;  // set to cancel a change
        bool stop = false;  // given up when the loop has ended, if a hook hangs
        // True for steps and replays, which end when they are given up.
        bool endless() const { return until_ns == INT64_MAX && given_up != nullptr; }
    };
    std::map<std::pair<std::uint64_t, std::uint64_t>, Waiting> waiting_;

    OutsideCalls calls_;
    PortStreams ports_;
    std::uint64_t next_watch_ = 1;

    std::mutex outbox_mutex_;
    std::deque<Outgoing> outbox_;
    std::uint64_t lost_records_ = 0;  // log records dropped because the outbox was full
};

}  // namespace rtcf::executor
