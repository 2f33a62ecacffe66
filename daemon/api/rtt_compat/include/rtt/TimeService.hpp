/// @file
/// By the name that OROCOS has for it.
#pragma once

#include "rtt/os/TimeService.hpp"
