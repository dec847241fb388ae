#pragma once
#include <cstdint>
namespace px4 {
struct wq_config_t {};
namespace wq_configurations {
static constexpr wq_config_t rate_ctrl{};
}
class ScheduledWorkItem {
public:
    ScheduledWorkItem(const char *, const wq_config_t &) {}
    virtual ~ScheduledWorkItem() = default;
    void ScheduleOnInterval(uint32_t) {}
    void ScheduleClear() {}
protected:
    virtual void Run() = 0;
};
}
