#include "symbols.h"
#include <cstdint>
#include <cstdlib>
#include <cxxabi.h>
#include <dlfcn.h>
#include <elf.h>
#include <fstream>
#include <vector>

namespace cairn_emulated {
std::string demangled(const char* name) {
    int status = 0;
    char* text = abi::__cxa_demangle(name, nullptr, nullptr, &status);
    std::string result = status == 0 ? text : name;
    std::free(text);
    return result;
}

std::string function_name(const void* address) {
    Dl_info module{};
    if (!dladdr(address, &module) || !module.dli_fname)
        return {};
    std::ifstream stream(module.dli_fname, std::ios::binary | std::ios::ate);
    if (!stream)
        return {};
    std::vector<char> file(static_cast<size_t>(stream.tellg()));
    stream.seekg(0);
    stream.read(file.data(), static_cast<std::streamsize>(file.size()));
    const auto* header = reinterpret_cast<const Elf64_Ehdr*>(file.data());
    if (file.size() < sizeof *header || header->e_ident[EI_CLASS] != ELFCLASS64 ||
        header->e_shoff + header->e_shnum * sizeof(Elf64_Shdr) > file.size())
        return {};
    // In a program that is not position-independent, symbols are addresses.
    const auto wanted =
        reinterpret_cast<std::uintptr_t>(address) - (header->e_type == ET_EXEC ? 0 : reinterpret_cast<std::uintptr_t>(module.dli_fbase));
    const auto* sections = reinterpret_cast<const Elf64_Shdr*>(file.data() + header->e_shoff);
    for (size_t s = 0; s < header->e_shnum; s++) {
        if (sections[s].sh_type != SHT_SYMTAB)
            continue;
        const auto* symbols = reinterpret_cast<const Elf64_Sym*>(file.data() + sections[s].sh_offset);
        const char* names = file.data() + sections[sections[s].sh_link].sh_offset;
        for (size_t i = 0; i < sections[s].sh_size / sizeof(Elf64_Sym); i++)
            if (ELF64_ST_TYPE(symbols[i].st_info) == STT_FUNC && symbols[i].st_value == wanted)
                return demangled(names + symbols[i].st_name);
    }
    return {};
}
} // namespace cairn_emulated
