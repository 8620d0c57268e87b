// Lets Bullet's float and double libraries live in one process.
//
// btTransform::getIdentity() and btMatrix3x3::getIdentity() are inline functions with a static object, under one name in both
// libraries. GCC marks such objects unique in the process, so that the library loaded second would use the first one's,
// of the wrong size and type. A definition in the module itself that is not unique comes first in the search of the
// module's own libraries, and each precision has its own again. CMake compiles the module with -fno-gnu-unique and exports
// the objects; this file makes sure that they are there.
#include <LinearMath/btTransform.h>

extern const void* const cairn_bullet_statics[2];
const void* const cairn_bullet_statics[2] = {&btTransform::getIdentity(), &btMatrix3x3::getIdentity()};
