// What tells one Bullet library from another, and where the half for it lies: cairn-run looks beforehand, the preload library once it
// is called, and neither may take what the other refuses.
#pragma once
#include <dlfcn.h>
#include <unistd.h>

#include <string>

#define CAIRN_STEP_FLOAT "_ZN23btDiscreteDynamicsWorld28internalSingleStepSimulationEf"
#define CAIRN_STEP_DOUBLE "_ZN23btDiscreteDynamicsWorld28internalSingleStepSimulationEd"

namespace cairn {
namespace preload {

// By its file's name, links followed: libBulletDynamics.so.3.24.
inline bool isOurVersion(const std::string& name) {
    const std::string ending = ".so." CAIRN_BULLET_VERSION;
    return name.size() >= ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

// "float" or "double", by what a loaded library defines; NULL if it cannot be told.
inline const char* precisionOf(void* library) {
    const bool isFloat = dlsym(library, CAIRN_STEP_FLOAT) != nullptr, isDouble = dlsym(library, CAIRN_STEP_DOUBLE) != nullptr;
    return isFloat == isDouble ? nullptr : isFloat ? "float" : "double";
}

inline std::string halfName(const std::string& precision) { return "libcairn_bullet_" + precision + ".so"; }

// In `folder` (which ends in /), or in cairn/ below it; "" if it is in neither.
inline std::string halfPath(const std::string& folder, const std::string& precision) {
    for (const char* below : {"cairn/", ""}) {
        const std::string path = folder + below + halfName(precision);
        if (access(path.c_str(), R_OK) == 0)
            return path;
    }
    return "";
}

} // namespace preload
} // namespace cairn
