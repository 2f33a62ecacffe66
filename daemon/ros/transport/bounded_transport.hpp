/// @file
/// How much the network may bring and leave here. Takes the place of functions of roscpp and
/// xmlrpcpp, which allocate what a peer says it will send, in memory that is locked:
///
/// - `Connection::read`: buffers come from unlocked memory; no more than a connection may bring
/// - `Connection::onHeaderLengthRead`: no more than a header has
/// - `TransportPublisherLink::onMessageLength`: a message that its input does not take is passed
///   over without being kept
/// - `TransportSubscriberLink::enqueueMessage`: what waits for a slow subscriber is bounded in
///   bytes; who takes nothing is noted when memory is scarce
/// - `XmlRpcSocket::nbRead`: a call or an answer is bounded
#pragma once

#include <memory>
#include <string>

#include "exchange/injector.hpp"

namespace rtcf::ros1 {

/// Messages of that topic which are larger than the injector takes are passed over, as long as
/// there is an injector. Any thread.
void boundTopic(const std::string& topic, const std::shared_ptr<executor::Injector>& injector);

}  // namespace rtcf::ros1
