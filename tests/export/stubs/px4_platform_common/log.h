#pragma once
#define PX4_WARN(...) ((void)sizeof(#__VA_ARGS__))
