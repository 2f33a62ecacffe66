/// @file
/// Reports to suppress in ThreadSanitizer, which does not see into Debian's roscpp.
/// The paths by which roscpp calls our code (callback queue, XML-RPC server, log) are
/// not in the list.

// NOLINTBEGIN(bugprone-reserved-identifier): the sanitizer's name
extern "C" const char* __tsan_default_suppressions();

extern "C" const char* __tsan_default_suppressions() {
    // NOLINTEND(bugprone-reserved-identifier)
    return
        // roscpp locks its own mutexes in varying order, all in its poll thread.
        "deadlock:libroscpp.so\n"
        // Objects counted by boost: the last owner is seen, roscpp's part of the count is not.
        "race:boost::detail::sp_counted\n"
        "race:ros::SerializedMessage\n"
        "race:ros::Publication::\n"
        "race:ros::Subscription::\n"
        "race:ros::TopicManager::\n"
        // Bytes passed between roscpp's threads.
        "race:ros::Connection::\n"
        "race:ros::TransportTCP\n"
        "race:ros::TransportSubscriberLink\n"
        "race:ros::TransportPublisherLink\n";
}
