#pragma once
#include <cstdint>
inline int px4_usleep(uint32_t) { return 0; }
