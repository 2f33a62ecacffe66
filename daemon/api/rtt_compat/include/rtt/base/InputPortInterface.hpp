/// @file
/// OROCOS' header of this name.
#pragma once

#include "rtt/Port.hpp"
