/// @file
/// What RTCF 2021's components include of OROCOS.
#pragma once

#include "rtt/Port.hpp"
#include "rtt/TaskContext.hpp"
