/// @file
/// OROCOS' main header: everything that RTCF 2021's components use.
#pragma once

#include "rtt/Logger.hpp"
#include "rtt/Port.hpp"
#include "rtt/TaskContext.hpp"
#include "rtt/Time.hpp"
#include "rtt/os/TimeService.hpp"
#include "rtt/rt_string.hpp"
