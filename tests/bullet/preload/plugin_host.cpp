// plugin_host PLUGIN KIND STEPS: a program that has Bullet from a plugin alone, which it keeps to itself (RTLD_LOCAL).
#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
    void* plugin = argc == 4 ? dlopen(argv[1], RTLD_NOW | RTLD_LOCAL) : nullptr;
    if (plugin == nullptr) {
        std::fprintf(stderr, "%s\n", argc == 4 ? dlerror() : "three arguments");
        return 1;
    }
    return reinterpret_cast<int (*)(const char*, int)>(dlsym(plugin, "bullet_plugin"))(argv[2], std::atoi(argv[3]));
}
