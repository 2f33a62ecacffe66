/// @file
/// OROCOS' header of this name.
#pragma once

#include "rtt/os/TimeService.hpp"
