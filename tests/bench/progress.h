// A bar for what takes minutes.
#pragma once
#include <cstddef>
#include <cstdio>
#include <string>

#if __has_include(<unistd.h>)
#include <unistd.h>
#endif

namespace cairn_bench {

// On stderr, where that is a terminal.
class Progress {
  public:
    explicit Progress(std::size_t count) : m_count(count) {}
    ~Progress() { clear(); }
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    void show(std::size_t done, const std::string& what) const {
        constexpr std::size_t width = 30;
        if (!m_shown)
            return;
        const std::size_t filled = m_count > 0 ? done * width / m_count : width;
        const std::string bar = std::string(filled, '#') + std::string(width - filled, '.');
        std::fprintf(stderr, "\r\033[K[%s] %zu/%zu %s", bar.c_str(), done, m_count, what.c_str());
        std::fflush(stderr);
    }
    void clear() const {
        if (!m_shown)
            return;
        std::fprintf(stderr, "\r\033[K");
        std::fflush(stderr);
    }

  private:
    static bool terminal() {
#if __has_include(<unistd.h>)
        return isatty(STDERR_FILENO) != 0;
#else
        return false;
#endif
    }
    std::size_t m_count;
    bool m_shown = terminal();
};

} // namespace cairn_bench
