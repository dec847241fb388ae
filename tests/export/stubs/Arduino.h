/* The part of Arduino that a skeleton uses: a test gives the time. */
#pragma once
#include <cstdint>
uint32_t micros();
