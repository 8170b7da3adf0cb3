// What Python calls to import the bundled module: hands on to the bindings that were compiled for the Python that asks.
// Without Python.h, which is of one Python only; these three names are the same in all.

#include <cstdio>
#include <cstdlib>

extern "C" {
const char* Py_GetVersion(void);
extern void* PyExc_ImportError;
void PyErr_SetString(void* type, const char* message);

#define PYTHON(major, minor, entry) void* entry(void);
TALBOT_PYTHONS
#undef PYTHON

__attribute__((visibility("default"))) void* PyInit__talbot(void);
}

void* PyInit__talbot(void) {
    char* rest = nullptr;
    const long running_major = std::strtol(Py_GetVersion(), &rest, 10);
    const long running_minor = std::strtol(rest + 1, nullptr, 10);
#define PYTHON(major, minor, entry) \
    if (running_major == major && running_minor == minor) return entry();
    TALBOT_PYTHONS
#undef PYTHON
    char message[200];
    int length = std::snprintf(message, sizeof message, "it is built for Python");
#define PYTHON(major, minor, entry) length += std::snprintf(message + length, sizeof message - size_t(length), " %d.%d", major, minor);
    TALBOT_PYTHONS
#undef PYTHON
    std::snprintf(message + length, sizeof message - size_t(length), ", and this is %ld.%ld", running_major, running_minor);
    PyErr_SetString(PyExc_ImportError, message);
    return nullptr;
}
