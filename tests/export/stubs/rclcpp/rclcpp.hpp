/* The part of rclcpp that a skeleton uses. */
#pragma once
#include <chrono>
#include <functional>
#include <memory>
#include <string>
namespace rclcpp {
struct Logger {};
class TimerBase {
public:
    using SharedPtr = std::shared_ptr<TimerBase>;
};
class Node {
public:
    explicit Node(const std::string &name) { (void)name; }
    template <typename Period, typename Callback>
    TimerBase::SharedPtr create_wall_timer(Period, Callback callback)
    {
        callback();
        return std::make_shared<TimerBase>();
    }
    Logger get_logger() const { return {}; }
};
inline void init(int, char **) {}
inline void spin(std::shared_ptr<Node>) {}
inline void shutdown() {}
}
#define RCLCPP_ERROR(logger, text) ((void)(logger), (void)(text))
