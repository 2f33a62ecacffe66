/// @file
/// Macros around the includes of OROCOS headers, which silenced warnings. RTCF 2021's components
/// use them; the headers of this layer need no silencing, so the macros are empty.
#pragma once

#define OROCOS_HEADERS_BEGIN
#define OROCOS_HEADERS_END
