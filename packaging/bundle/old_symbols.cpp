// The bundle runs with glibc 2.34 and libstdc++ 6.0.29 (RHEL 9, Ubuntu 22.04), but is linked with those of Debian 12, whose
// linker prefers the newest version of each name. Three names have newer versions that do nothing else that matters here; calls
// of them are wrapped (--wrap) and end at the old ones.
//
//   hypot, hypotf                   GLIBC_2.35: the same without setting errno's wrapper
//   condition_variable::wait        GLIBCXX_3.4.30: no longer throws
//
// `./talbot package` reads the finished module and fails when another such name has crept in.

#include <cmath>
#include <condition_variable>
#include <mutex>

extern "C" {
double old_hypot(double, double);
float old_hypotf(float, float);
void old_wait(std::condition_variable*, std::unique_lock<std::mutex>*);

__asm__(".symver old_hypot, hypot@GLIBC_2.2.5");
__asm__(".symver old_hypotf, hypotf@GLIBC_2.2.5");
__asm__(".symver old_wait, _ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE@GLIBCXX_3.4.11");

double __wrap_hypot(double x, double y) {
    return old_hypot(x, y);
}
float __wrap_hypotf(float x, float y) {
    return old_hypotf(x, y);
}
// A member function's object is its first argument, and a reference is passed as a pointer.
void __wrap__ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE(std::condition_variable* self, std::unique_lock<std::mutex>* lock) {
    old_wait(self, lock);
}
}
