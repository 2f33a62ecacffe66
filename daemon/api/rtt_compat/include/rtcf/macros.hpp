/// @file
/// Brackets around what once were OROCOS headers. RTCF 2021's source asks for
/// them; the headers of this layer need no warnings silenced.
#pragma once

#define OROCOS_HEADERS_BEGIN
#define OROCOS_HEADERS_END
