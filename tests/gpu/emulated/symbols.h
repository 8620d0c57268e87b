// Names of functions, for messages.
#pragma once
#include <string>

namespace cairn_emulated {
// The function's name from the symbol table of its module, local functions included; empty if there is none.
std::string function_name(const void* address);
std::string demangled(const char* name);
} // namespace cairn_emulated
