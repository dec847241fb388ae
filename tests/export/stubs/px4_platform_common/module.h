/* The part of PX4's modules that a skeleton uses. */
#pragma once
#include <atomic>
#define __EXPORT
#define MODULE_NAME "skeleton"
#define PX4_OK 0
#define PX4_ERROR (-1)
constexpr int task_id_is_work_queue = -2;
template <class T> class ModuleBase {
public:
    static int main(int argc, char *argv[]) { return argc > 1 ? T::custom_command(argc, argv) : T::task_spawn(argc, argv); }
protected:
    bool should_exit() const { return false; }
    void exit_and_cleanup() {}
    static std::atomic<T *> _object;
    static int _task_id;
};
template <class T> std::atomic<T *> ModuleBase<T>::_object{nullptr};
template <class T> int ModuleBase<T>::_task_id = -1;
