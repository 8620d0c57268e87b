// Results as JSON.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <locale>
#include <optional>
#include <sstream>
#include <string>

namespace cairn_bench {

// Writes JSON as it is called; commas and quotes are its affair.
class Json {
  public:
    Json() {
        m_text.imbue(std::locale::classic());
        m_text.precision(6);
    }
    std::string text() const { return m_text.str() + "\n"; }
    Json& key(const char* name) {
        next();
        quote(name);
        m_text << ": ";
        m_begun = false;
        return *this;
    }
    void open(char bracket) {
        next();
        m_text << bracket;
        m_begun = false;
    }
    void close(char bracket) {
        m_text << bracket;
        m_begun = true;
    }
    void value(const std::string& text) {
        next();
        quote(text);
    }
    void value(const char* text) { value(std::string(text)); }
    void value(bool yes) {
        next();
        m_text << (yes ? "true" : "false");
    }
    void value(double number) {
        next();
        if (std::isfinite(number))
            m_text << number;
        else
            m_text << "null"; // JSON has no other
    }
    void value(std::size_t number) {
        next();
        m_text << number;
    }
    void value(std::uint32_t number) { value(std::size_t{number}); }
    void value(int number) { value(static_cast<std::size_t>(number)); }
    template <class T> void value(const std::optional<T>& maybe) {
        if (maybe)
            return value(*maybe);
        next();
        m_text << "null";
    }
    void line() { m_break = true; } // the next value begins a line

  private:
    void next() {
        if (m_begun)
            m_text << ',';
        if (m_break)
            m_text << '\n';
        else if (m_begun)
            m_text << ' ';
        m_begun = true;
        m_break = false;
    }
    void quote(const std::string& text) {
        m_text << '"';
        for (const char c : text) {
            if (c == '"' || c == '\\')
                m_text << '\\' << c;
            else if (static_cast<unsigned char>(c) < 0x20)
                m_text << ' ';
            else
                m_text << c;
        }
        m_text << '"';
    }
    std::ostringstream m_text;
    bool m_begun = false, m_break = false;
};

} // namespace cairn_bench
