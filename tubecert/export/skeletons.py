"""Programs around an exported controller, to be completed by who knows the machine: Arduino, ROS 2, PX4.

In: a `Controller` in C. Out: the name and the text of one file of C++. What measures and what acts are left open, and
do nothing: as it is written, such a program stops at its first sample. Untrusted, and no part of what `recheck`
examines.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from string import Template
from typing import Final, Literal

from tubecert.export.c_language import comment
from tubecert.export.controller import Controller, refused

Platform = Literal["arduino", "ros2", "px4"]

_MICRO: Final = 10**6
_HEAD: Final = (
    "A skeleton, and yours to change: fill in what says TODO. It is no part of what tubecert proves or checks.",
    "The certificate is about samples that are on time, a state that is measured at them, and inputs that act after",
    "exactly the delay; where that cannot be kept, it stops.",
)
_OPEN: Final = """\
namespace {

constexpr uint32_t PERIOD = $period; /* us */
constexpr uint32_t DELAY = $delay;  /* us, from a sample to the input that is computed from it */

/* TODO: measure $states, in this order; false: there is no measurement. */
bool measure(${name}_real *y)
{
    (void)y;
    return false;
}

/* TODO: apply $inputs, in this order. */
void apply(const ${name}_real *u)
{
    (void)u;
}

/* TODO: what the machine does when the certificate says nothing any more; `status` is what step said. */
void stop(int status)
{
    (void)status;
}

${name}_state controller;
${name}_real y[${big}_STATES], u[${big}_INPUTS];
bool started = false, running = true;

/* One sample, which began at `now`; `act_at(time)` waits. */
template <typename Wait>
void sample(Wait act_at)
{
    int status = 0;
    if (!measure(y)) {
        running = false;
    } else {
        if (!started) {
            status = ${name}_start(&controller, y, u);
            apply(u);
            started = true;
        }
        status |= ${name}_step(&controller, y, u);
        running = status == 0;
    }
    if (!running) {
        stop(status);
        return;
    }
    act_at();
    apply(u);
}

}
"""
_ARDUINO: Final = """\
#include <Arduino.h>

extern "C" {
#include "$name.h"
}

$open
static uint32_t next;

void setup()
{
    next = micros();
}

void loop()
{
    const uint32_t late = micros() - next;
    if (!running || late > UINT32_MAX / 2) {
        return; /* not yet */
    }
    if (started && late >= PERIOD) {
        running = false; /* a sample was missed */
        stop(0);
        return;
    }
    sample([] {
        while (micros() - next < DELAY) {
        }
    });
    next += PERIOD;
}
"""
_ROS2: Final = """\
#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>

#include <rclcpp/rclcpp.hpp>

extern "C" {
#include "$name.h"
}

$open
class Loop : public rclcpp::Node {
public:
    Loop() : rclcpp::Node("$name")
    {
        /* TODO: subscriptions that measure() reads and publishers that apply() writes to */
        timer_ = create_wall_timer(std::chrono::microseconds(PERIOD), [this] { tick(); });
    }

private:
    void tick()
    {
        const auto now = std::chrono::steady_clock::now();
        if (!running) {
            return;
        }
        if (started && now - last_ > std::chrono::microseconds(PERIOD + PERIOD / 2)) {
            running = false; /* a sample was missed */
            stop(0);
            return;
        }
        last_ = now;
        sample([now] { std::this_thread::sleep_until(now + std::chrono::microseconds(DELAY)); });
        if (!running) {
            RCLCPP_ERROR(get_logger(), "stopped: an assumption does not hold, or the horizon is over");
        }
    }

    std::chrono::steady_clock::time_point last_;
    rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char **argv)
{
    rclcpp::init(argc, argv);
    rclcpp::spin(std::make_shared<Loop>());
    rclcpp::shutdown();
    return 0;
}
"""
_PX4: Final = """\
#include <drivers/drv_hrt.h>
#include <px4_platform_common/log.h>
#include <px4_platform_common/module.h>
#include <px4_platform_common/px4_work_queue/ScheduledWorkItem.hpp>
#include <px4_platform_common/time.h>

extern "C" {
#include "$name.h"
}

$open
class Loop : public ModuleBase<Loop>, public px4::ScheduledWorkItem {
public:
    Loop() : ScheduledWorkItem(MODULE_NAME, px4::wq_configurations::rate_ctrl) {}

    static int task_spawn(int argc, char *argv[])
    {
        (void)argc;
        (void)argv;
        Loop *own = new Loop();
        if (own == nullptr) {
            return PX4_ERROR;
        }
        _object.store(own);
        _task_id = task_id_is_work_queue;
        own->ScheduleOnInterval(PERIOD);
        return PX4_OK;
    }

    static int custom_command(int argc, char *argv[])
    {
        (void)argc;
        (void)argv;
        return print_usage("unknown command");
    }

    static int print_usage(const char *reason = nullptr)
    {
        if (reason != nullptr) {
            PX4_WARN("%s", reason);
        }
        return PX4_OK;
    }

private:
    void Run() override
    {
        const hrt_abstime now = hrt_absolute_time();
        if (should_exit() || !running) {
            ScheduleClear();
            exit_and_cleanup();
            return;
        }
        if (started && now - _last > PERIOD + PERIOD / 2) {
            running = false; /* a sample was missed */
            stop(0);
            return;
        }
        _last = now;
        sample([now] {
            const hrt_abstime passed = hrt_absolute_time() - now;
            if (passed < DELAY) {
                px4_usleep(static_cast<uint32_t>(DELAY - passed)); /* TODO: a queue of its own, which may sleep */
            }
        });
    }

    hrt_abstime _last{0};
};

extern "C" __EXPORT int ${name}_main(int argc, char *argv[])
{
    return Loop::main(argc, argv);
}
"""
_FILES: Final[Mapping[Platform, tuple[str, str]]] = {
    "arduino": ("_arduino.ino", _ARDUINO),
    "ros2": ("_node.cpp", _ROS2),
    "px4": ("_px4.cpp", _PX4),
}


def skeleton(controller: Controller, platform: Platform) -> tuple[str, str]:
    """The name and the text of the file; raises TC710 for a loop that such a program cannot run."""
    if not controller.adds_plan:
        raise refused(
            f"u* moves between samples, and a program for {platform} acts at samples only",
            "certify with hardware: {feedforward: held}",
        )
    end, text = _FILES[platform]
    names = {
        "name": controller.name,
        "big": controller.name.upper(),
        "period": str(_whole(controller.sample_time, "sample time")),
        "delay": str(_whole(controller.delay, "delay")),
        "states": ", ".join(controller.states),
        "inputs": ", ".join(controller.inputs),
    }
    head = "\n".join(comment((f"{controller.system}: a program for {platform} around it.", *_HEAD)))
    body = Template(text).substitute(names, open=Template(_OPEN).substitute(names))
    return f"{controller.name}{end}", f"{head}\n{body}"


def _whole(value: Fraction, what: str) -> int:
    """In microseconds."""
    found = value * _MICRO
    if found.denominator != 1:
        raise refused(
            f"the {what} is no whole number of microseconds, which timers of this machine count",
            "certify another one",
        )
    return int(found)
