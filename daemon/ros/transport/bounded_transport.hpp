/// @file
/// Limits on the memory of the network. Replaces functions of roscpp and xmlrpcpp, which allocate
/// any length that a peer announces, in locked memory:
///
/// - `Connection::read`: limits the length, and uses unlocked memory
/// - `Connection::onHeaderLengthRead`: limits the length of a header
/// - `TransportPublisherLink::onMessageLength`: skips messages that the injector does not accept,
///   without storing them
/// - `TransportSubscriberLink::enqueueMessage`: limits the bytes queued for a slow subscriber, and
///   notes idle subscribers when memory is scarce
/// - `XmlRpcSocket::nbRead`: limits the length of a call or an answer
#pragma once

#include <memory>
#include <string>

#include "exchange/injector.hpp"

namespace rtcf::ros1 {

/// Skips messages of the topic that are larger than the injector accepts, during the life of the
/// injector. Any thread.
void boundTopic(const std::string& topic, const std::shared_ptr<executor::Injector>& injector);
/// The injector of a bound topic; null = none. Any thread.
std::shared_ptr<executor::Injector> injectorOf(const std::string& topic);

}  // namespace rtcf::ros1
